"""Rates to divisors, what does not fit, and stability figures."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from ic.meaning.control.schedule import exact
from met import run as engine
from met.plan import Experiment
from tests.ic.small_decks import ARM, LIGHT, RUN, SERVO, changed, check, codes, experiment

RATES = "dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz;"


def with_rates(rates: str, duration: str = "1 s") -> tuple[str, ...]:
    return (ARM, SERVO, changed(RUN, (RATES, rates), ("duration = 1 s", f"duration = {duration}")))


def divisors(run: Experiment) -> tuple[float, int, int, int]:
    schedule = run.structure.schedule
    return schedule.base_hz, schedule.dynamics, schedule.record, run.structure.servos[0].divisor


@pytest.mark.parametrize(
    ("rates", "expected"),
    [
        ("dynamics = 1 kHz; servos = 500 Hz; record = 50 Hz;", (1000.0, 1, 20, 2)),
        ("dynamics = 100 Hz; servos = 1 kHz; record = 50 Hz;", (1000.0, 10, 20, 1)),  # the fastest is the base
        ("dynamics = 1 kHz; servos = 500 Hz;", (1000.0, 1, 1, 2)),  # recorded at every step
        ("dynamics = 1 kHz; servos = 1 kHz; base = 4 kHz;", (4000.0, 4, 4, 4)),
        ("dynamics = 1 kHz; servos = (1000/3) Hz; record = 100 Hz;", (1000.0, 1, 10, 3)),  # exact, though no decimal is
        ("dynamics = 200 Hz; servos = 300 Hz; record = 100 Hz; base = 600 Hz;", (600.0, 3, 6, 2)),
    ],
)
def test_rates_are_divisors_of_the_base(tmp_path: Path, rates: str, expected: tuple[float, ...]) -> None:
    assert divisors(experiment(tmp_path, *with_rates(rates))) == expected


def test_a_servos_own_rate_wins(tmp_path: Path) -> None:
    servo = changed(SERVO, ("ratio = 100;", "ratio = 100; rate = 250 Hz;"))
    assert divisors(experiment(tmp_path, ARM, servo, RUN)) == (1000.0, 1, 10, 4)


def test_a_rate_that_does_not_divide_is_told_with_what_fits(tmp_path: Path) -> None:
    compiled = check(tmp_path, *with_rates("dynamics = 1 kHz; servos = 300 Hz; record = 100 Hz;"))
    (diagnostic,) = compiled.diagnostics
    assert diagnostic.code == "D100"
    assert diagnostic.message == "`servos` at 300 Hz does not divide the base rate, 1000 Hz"
    assert diagnostic.help == (
        "nearest that fit: 333.333 Hz, written (1000/3) Hz, 250 Hz (1000/4)",
        "or a base rate that all divide: `base = 3000 Hz;` in `rates`",
    )


def test_a_base_rate_that_is_the_only_remedy_is_no_alternative(tmp_path: Path) -> None:
    rates = "dynamics = 1 kHz; servos = 2 kHz; record = 100 Hz; base = 1 kHz;"
    (found,) = check(tmp_path, *with_rates(rates)).diagnostics
    assert found.message == "`servos` at 2000 Hz is faster than the base rate, 1000 Hz"
    assert found.help == ("a base rate that all divide: `base = 2000 Hz;` in `rates`",)


def test_what_the_message_proposes_compiles(tmp_path: Path) -> None:
    for servos, base in (("(1000/3) Hz", ""), ("250 Hz", ""), ("300 Hz", "base = 3000 Hz;")):
        assert codes(tmp_path, *with_rates(f"dynamics = 1 kHz; servos = {servos}; record = 100 Hz; {base}")) == []


def test_a_rate_faster_than_a_written_base_is_told(tmp_path: Path) -> None:
    assert codes(tmp_path, *with_rates("dynamics = 1 kHz; servos = 2 kHz; base = 1 kHz;")) == ["D100"]


@pytest.mark.parametrize(
    ("value", "fraction"),
    [
        (1000 / 3, Fraction(1000, 3)),
        (0.1, Fraction(1, 10)),
        (25.0, Fraction(25)),
        (333.3, Fraction(3333, 10)),
        (20.01, Fraction(2001, 100)),
    ],
)
def test_a_number_is_the_simplest_fraction_that_it_can_be(value: float, fraction: Fraction) -> None:
    assert exact(value) == fraction


def test_a_run_has_both_ends(tmp_path: Path) -> None:
    schedule = experiment(tmp_path, *with_rates(RATES, "0.3 s")).structure.schedule
    assert (schedule.ticks, schedule.rows, schedule.duration) == (300, 31, 0.3)


def test_a_duration_between_steps_is_told_with_its_neighbours(tmp_path: Path) -> None:
    (diagnostic,) = check(tmp_path, *with_rates(RATES, "1.0005 s")).diagnostics
    assert (diagnostic.code, diagnostic.help) == ("D101", ("nearest that fit: 1 s, 1.001 s",))


def test_an_end_that_is_not_recorded_is_warned_of(tmp_path: Path) -> None:
    compiled = check(tmp_path, *with_rates(RATES, "1.005 s"))
    assert [(d.code, d.severity) for d in compiled.diagnostics] == [("D102", "warning")]
    assert compiled.plan is not None


@pytest.mark.parametrize(
    ("duration", "code"),
    [("1e300 s", "D103"), ("1e308 s", "D103"), ("0 s", "D077"), ("-1 s", "D077"), ("3", "D060")],
)
def test_a_duration_that_cannot_be_is_told(tmp_path: Path, duration: str, code: str) -> None:
    assert code in codes(tmp_path, *with_rates(RATES, duration))


@pytest.mark.parametrize(
    ("rates", "code"),
    [
        ("servos = 1 kHz;", "D117"),
        ("dynamics = 1 kHz;", "D118"),
        ("dynamics = 1 kHz; servo = 1 kHz;", "D116"),
        ("dynamics = 0 Hz; servos = 1 kHz;", "D077"),
        ("dynamics = 60 rpm; servos = 1 kHz;", "D061"),
        ("dynamics = 1000; servos = 1 kHz;", "D060"),
        ("dynamics = continuous; servos = 1 kHz;", "D106"),
    ],
)
def test_rates_that_cannot_be_are_told(tmp_path: Path, rates: str, code: str) -> None:
    assert code in codes(tmp_path, *with_rates(rates))


def lagging(h_lambda: float) -> str:
    """The servo with a rotor so light that h lambda at 1 kHz is this: (kt^2/R)/j_m/1000."""
    return changed(SERVO, ("j_m = 1e-4", f"j_m = {0.05**2 / 1.0 / h_lambda / 1000.0!r}"))


def test_the_fastest_mode_is_noted(tmp_path: Path) -> None:
    """1 - x + x^2/2 of exp(-x), x = 0.25."""
    (note,) = experiment(tmp_path, LIGHT, lagging(0.25), RUN).notes
    assert note.startswith(
        "step size: joint `hinge` decays with 250 1/s: h * lambda = 0.25, and a step makes 0.781 of it, in truth 0.779 ("
    )
    assert note.endswith("deck.ic:13)")
    (note,) = experiment(tmp_path, ARM, lagging(0.25), changed(RUN, ("dynamics = 1 kHz", "dynamics = 10 kHz"))).notes
    assert note == "step size: nothing changes by more than 1 % in a step"


@pytest.mark.parametrize(("count", "said"), [(1, "of all that varies"), (20, " of the 20 that vary")])
def test_of_a_sweep_it_is_noted_which_ends_were_looked_at(count: int, said: str, tmp_path: Path) -> None:
    """Drawn at random, the ends stand anywhere in the table; of 20 numbers there is no time for all."""
    names = [f"angle_{n}" for n in range(count)]
    lets = "".join(f"let {name} = 0 rad;\n" for name in names)
    run = changed(RUN, ("duration", f"initial {{ hinge.q = {' + '.join(names)}; }}\n    duration"))
    drawn = "".join(f"{name} = uniform(0, 1) rad; " for name in names)
    sweep = f"sweep drawn of hold {{ sample random(500) {{ {drawn}}} }}\n"
    made = experiment(tmp_path, ARM, SERVO, lets, run, sweep, select=["drawn"])
    (note,) = (each for each in made.notes if each.startswith("step size: "))
    assert "; looked at " in note and " of 500 cases, with the least and the largest of" in note
    assert note.endswith(f"{said}: the others are left to the run")


def test_h_lambda_above_a_half_warns(tmp_path: Path) -> None:
    compiled = check(tmp_path, LIGHT, lagging(0.51), RUN)
    assert [(d.code, d.severity) for d in compiled.diagnostics] == [("D105", "warning")]
    assert codes(tmp_path, LIGHT, lagging(0.49), RUN) == []


def test_h_lambda_at_the_limit_is_an_error_that_names_the_slowest_rate_that_fits(tmp_path: Path) -> None:
    (diagnostic,) = check(tmp_path, LIGHT, lagging(2.001), RUN).diagnostics
    assert diagnostic.code == "D104"
    assert diagnostic.at is not None and diagnostic.at.text.endswith("the slowest rate that fits is 2000 Hz")
    assert codes(tmp_path, LIGHT, lagging(1.999), RUN) == ["D105"]


def test_the_slowest_rate_that_fits_does(tmp_path: Path) -> None:
    """At 1 kHz h lambda is 0.9; at 100 Hz it would be 9, and 500 Hz is the slowest whole divisor below 2."""
    rates = "dynamics = 100 Hz; servos = 1 kHz; record = 100 Hz;"
    (diagnostic,) = check(tmp_path, LIGHT, lagging(0.9), with_rates(rates)[2]).diagnostics
    assert diagnostic.at is not None and "the slowest rate that fits is 500 Hz" in diagnostic.at.text
    faster = with_rates("dynamics = 500 Hz; servos = 1 kHz; record = 100 Hz;")[2]
    assert codes(tmp_path, LIGHT, lagging(0.9), faster) == ["D320", "D105"], "the loop swings from limit to limit"


def test_what_a_servo_alone_cannot_bear_it_may_before_its_arm(tmp_path: Path) -> None:
    """Of 2500 1/s the arm of 2/3 kg m^2 leaves 37 1/s, and the run is as it is at a step ten times shorter."""
    slow = experiment(tmp_path, ARM, lagging(2.5), RUN)
    fast = experiment(tmp_path, ARM, lagging(2.5), changed(RUN, ("dynamics = 1 kHz", "dynamics = 10 kHz")))
    assert codes(tmp_path, ARM, lagging(2.5), RUN) == []
    ends = [engine.run(each).signals["q"][0, -1, 0] for each in (slow, fast)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-4) and ends[0] > 0.05


def test_stability_of_a_sweep_is_that_of_its_worst_case(tmp_path: Path) -> None:
    sweep = "sweep rotors of hold { vary drive.j_m = [1e-4, 1e-5, 1e-6] kg*m^2; }"
    (diagnostic,) = check(tmp_path, LIGHT, SERVO, RUN, sweep, select=["rotors"]).diagnostics
    assert diagnostic.code == "D104"
    assert "case #2" in diagnostic.message


@pytest.mark.parametrize(
    ("change", "more"),
    [
        (("resistance = 1 ohm", "resistance = 0 ohm"), ""),
        (("j_m = 1e-4 kg*m^2", "j_m = 0 kg*m^2"), ""),
        (("", ""), "sweep it of hold { vary drive.resistance = [0, 1] ohm; }"),
    ],
)
def test_nothing_is_computed_of_a_servo_whose_parameter_is_out_of_range(
    tmp_path: Path, change: tuple[str, str], more: str
) -> None:
    assert codes(tmp_path, ARM, changed(SERVO, change), RUN, more, select="all") == ["D077"]


def test_a_value_of_a_base_that_is_wrong_is_told_once_for_all_its_users(tmp_path: Path) -> None:
    both = "servo left like drive { kp = 0.2 V*s/rad; }\nservo right like drive { kp = 0.3 V*s/rad; }\n"
    runs = "run a like hold { servos { hinge = left; } }\nrun b like hold { servos { hinge = right; } }\n"
    assert codes(tmp_path, ARM, changed(SERVO, ("ki = 1 V/rad", "ki = 1")), both, RUN, runs, select="all") == ["D060"]
