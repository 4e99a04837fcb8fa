"""Servo loops that tick: limits of stability against closed forms of sampled systems, and against runs."""

from __future__ import annotations

import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.analysis import blame
from met.analysis import loops as servo_loops
from met.analysis.blame import Unstable, closed
from met.analysis.loops import fastest, frame, growing, growths, parts_in, spectrum, uncoupled
from met.analysis.step_map import Linearizer
from met.plan import Experiment
from tests.ic.small_decks import changed, check, experiment

DECK = """\
arm swing {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo drive {
    model = rigid_gearbox;  ratio = 10;  kp = KP V*s/rad;  ki = 0 V/rad;  v_max = 1e9 V;  resistance = 1 ohm;
    kt = 0.5 N*m/A;  tau_max = 1e9 N*m;  j_m = 1e-2 kg*m^2;  command = COMMAND;
}
run hold {
    arm = swing;
    servos { hinge = drive; }
    rates { dynamics = 10 kHz;  servos = 50 Hz; }
    duration = 4 s;
    record = [qd];
}
"""
PERIOD, DECAY = 0.02, 12.5  # T, s; a = N^2 Kt^2/(R (J + N^2 J_m)), 1/s
LIMIT = (1.0 + math.exp(-DECAY * PERIOD)) / (1.0 - math.exp(-DECAY * PERIOD)) * 0.5
"""Of qd+ = e^-aT qd - (1 - e^-aT) (Kp/Kt) qd: kp at which the factor is -1, V s/rad."""


def deck(kp: float, command: str = "rate(0.1 rad/s)") -> str:
    return changed(DECK, ("KP", repr(kp)), ("COMMAND", command))


def loops(experiment: Experiment) -> tuple[Unstable, ...]:
    linearizer = Linearizer(experiment, [0])
    sampled = linearizer.sampled()
    assert sampled is not None
    return closed(linearizer, sampled, growing(sampled, fastest(sampled), experiment.structure.schedule.duration))


def test_the_factor_of_a_rate_loop_is_that_of_the_closed_form(tmp_path: Path) -> None:
    sampled = Linearizer(experiment(tmp_path, deck(2.0)), [0]).sampled()
    assert sampled is not None
    sizes = np.linalg.eigvals(frame(sampled, 0))
    e = math.exp(-DECAY * PERIOD)
    assert np.abs(sizes - (e - (1.0 - e) * 2.0 / 0.5)).min() < 1e-6


def test_its_limit_is_that_of_the_closed_form(tmp_path: Path) -> None:
    """The gain that is named is where the loop grows by e over the run: a little above the limit."""
    assert loops(experiment(tmp_path, deck(0.99 * LIMIT))) == ()
    (found,) = loops(experiment(tmp_path, deck(2.0 * LIMIT)))
    assert found.joints == ("hinge",) and found.gain == pytest.approx(0.5, rel=0.01)


@pytest.mark.release
@pytest.mark.parametrize("hz", [1000, 50, 25, 10])
def test_it_is_on_the_right_side_of_the_limit_of_runs(hz: int, tmp_path: Path) -> None:
    """Steps shorter than a tick, as long, and longer: then memory goes evenly over the step."""

    def grows(kp: float) -> bool:
        part = changed(deck(kp), ("dynamics = 10 kHz", f"dynamics = {hz} Hz"), ("duration = 4 s", "duration = 20 s"))
        with np.errstate(all="ignore"):
            qd = engine.run(experiment(tmp_path, part)).signals["qd"][0, :: max(1, hz // 50), 0]
        changes = np.abs(np.diff(qd))
        return not changes[-1] < changes[1]

    low, high = 0.01, 20.0
    for _ in range(12):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    for share, count in ((0.95, 0), (1.05, 1)):
        made = experiment(tmp_path, changed(deck(share * high), ("dynamics = 10 kHz", f"dynamics = {hz} Hz")))
        assert len(loops(made)) == count, (share, high)


TWO = """\
arm pair {
    link a { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    link b { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint one revolute { parent = base;  child = a;  axis = z; }
    joint two revolute { parent = base;  child = b;  axis = z; }
}
servo drive {
    model = rigid_gearbox;  ratio = 10;  kp = 1 V*s/rad;  ki = 0 V/rad;  v_max = 24 V;  resistance = 1 ohm;
    kt = 0.5 N*m/A;  tau_max = 10 N*m;  j_m = 1e-2 kg*m^2;  command = rate(0.1 rad/s);
}
servo eager like drive { kp = 9 V*s/rad; }
run hold {
    arm = pair;  servos { one = drive;  two = eager; }
    rates { dynamics = 1 kHz;  servos = 50 Hz; }
    duration = 4 s;  record = [qd];
}
"""


def test_only_the_loop_is_blamed_whose_gain_is_too_large(tmp_path: Path) -> None:
    """Here two loops do not meet: each has the limit of one alone. The gain that is named is inside of it, a share of
    the deck's with two digits."""
    (found,) = check(tmp_path, TWO, select="all").diagnostics
    assert found.code == "D320" and "on joint `two`" in found.message
    kp = re.search(r"kp = ([0-9.]+) V", found.help[0])
    assert kp is not None and 0.95 * LIMIT < float(kp[1]) <= 0.98 * LIMIT
    torque = changed(TWO, ("kp = 9 V*s/rad;", "kp = 9 V*s/rad;  command = torque(1 N*m);"))
    assert check(tmp_path, torque, select="all").diagnostics == ()


SWINGS = changed(
    deck(0.05, "position(0.1 rad)"),
    ("ki = 0 V/rad", "ki = 30 V/rad;  k_position = 30 1/s"),
    ("servos = 50 Hz", "servos = 2 kHz"),
)
"""s^3 + (a + b) s^2 + (c + b k) s + c k, a = 12.5, b = 1.25, c = 750, k = 30: (a + b)(c + b k) < c k."""


@pytest.mark.slow
@pytest.mark.parametrize("rate", ["", "rate = continuous;  "])
def test_a_loop_that_swings_up_without_ticks_too_is_told_by_itself(rate: str, tmp_path: Path) -> None:
    """Below c = (a + b) b k/(k - a - b) it does not: ki = 1.269 V/rad, a little more with e over the run."""
    swings = changed(SWINGS, ("kp = 0.05", f"{rate}kp = 0.05"))
    (found,) = check(tmp_path, swings, select="all").diagnostics
    assert found.code == "D322"
    assert found.message.startswith("the loop of servo `drive` is unstable by itself on joint `hinge`: a disturbance ")
    named = {name: float(value) for name, value in re.findall(r"(\w+) = ([0-9.]+)", found.help[0])}
    longest = changed(swings, ("duration = 4 s", "duration = 1000 s"), ("dynamics = 10 kHz", "dynamics = 2 kHz"))
    (found,) = check(tmp_path, longest, select="all").diagnostics
    exact = {name: float(value) for name, value in re.findall(r"(\w+) = ([0-9.]+)", found.help[0])}
    assert list(named) == ["kp", "ki", "k_position"] and found.help[0].endswith(", each alone")
    assert exact["ki"] == pytest.approx(13.75 * 1.25 * 30.0 / (30.0 - 13.75) / 25.0, rel=0.03)
    qd = engine.run(experiment(tmp_path, swings)).signals["qd"][0, :, 0]
    assert np.abs(qd[-5000:]).max() > 10.0 * np.abs(qd[:5000]).max()


FALLS = changed(
    deck(0.05), ("com = [0, 0, 0] m", "com = [0, 1, 0] m"), ("    duration", "    GRAVITY\n    duration"),
    ("servos { hinge = drive; }", "SERVOS"),
)  # fmt: skip
UP = "environment { g = gravity { g = [0, -9.81, 0] m/s^2; } }"


@pytest.mark.parametrize(
    "servos",
    [
        "",
        "servos { hinge = drive { command = torque(0 N*m); } }",
        "servos { hinge = drive { kp = 0 V*s/rad; } }",
        "servos { hinge = drive; }",
        "servos { hinge = drive { kp = 1 V*s/rad;  ki = 10 V/rad; } }",
    ],
)
def test_what_falls_by_itself_is_no_loops_fault(servos: str, tmp_path: Path) -> None:
    """A pendulum upright: without a servo, with one that is off, and with one that lets it creep, or holds it."""
    falls = changed(FALLS, ("GRAVITY", UP), ("SERVOS", servos))
    assert check(tmp_path, falls, select="all").diagnostics == ()


@pytest.mark.slow
def test_a_loop_that_is_too_weak_to_hold_its_joint_is_told(tmp_path: Path) -> None:
    """With k_position alone: it falls where k (N Kt/R) kp N < m g l, and N^2 Kt/R kp k = 9.81 N m/rad is the limit."""
    weak = "servos { hinge = drive { kp = 0.1 V*s/rad;  k_position = 1 1/s;  command = position(0 rad); } }"
    deck_of = changed(FALLS, ("GRAVITY", UP), ("SERVOS", weak), ("duration = 4 s", "duration = 100 s"))
    (found,) = check(tmp_path, deck_of, select="all").diagnostics
    assert found.code == "D322" and "is too weak to hold joint `hinge`" in found.message
    kp = re.search(r"kp = ([0-9.]+) V\*s/rad and more", found.help[0])
    assert kp is not None and float(kp[1]) == pytest.approx(9.81 / 50.0, rel=0.05)


def _characteristic(e: float, ticks: int) -> list[float]:
    """Coefficients of z^(d+1) - e z^d + (1 - e) kp/kt, kp/kt = 0.1."""
    return [1.0, -e, *([0.0] * (ticks - 1)), 0.1 * (1.0 - e)] if ticks else [1.0, -e + 0.1 * (1.0 - e)]


def test_a_sensors_filter_and_its_delay_are_part_of_a_loop(tmp_path: Path) -> None:
    """A delay of d ticks on a loop of rate, whose factor solves z^(d+1) - e z^d + (1 - e) kp/kt = 0."""
    e = math.exp(-DECAY * PERIOD)
    for ticks in (0, 1, 2, 3):
        late = changed(
            deck(0.05, "rate(0.1 rad/s)"), ("    kt", f"    sensor qd = tachometer {{ delay = {ticks}; }}\n    kt")
        )
        sampled = Linearizer(experiment(tmp_path, late), [0]).sampled()
        assert sampled is not None
        roots = np.roots(
            [1.0, -e, *([0.0] * (ticks - 1)), (1.0 - e) * 0.05 / 0.5] if ticks else [1.0, -e + (1 - e) * 0.1]
        )
        sizes = np.linalg.eigvals(frame(sampled, 0))
        for root in roots:
            assert np.abs(sizes - root).min() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    "sensor", ["encoder { step = 0.01 rad/s; }", "tachometer { resolution = 0.03 rad/s;  noise = 0.1 rad/s; }"]
)
def test_steps_and_noise_of_a_sensor_are_no_change_of_its_slope(sensor: str, tmp_path: Path) -> None:
    for made in (deck(0.99 * LIMIT), deck(2.0 * LIMIT)):
        coarse = changed(made, ("    kt", f"    sensor qd = {sensor}\n    kt"))
        assert [each.gain for each in loops(experiment(tmp_path, coarse))] == pytest.approx(
            [each.gain for each in loops(experiment(tmp_path, made))], rel=2e-3
        )


def test_slopes_whose_step_overflows_are_no_defect(tmp_path: Path) -> None:
    deck_of = "#include <two_link.ic>\nsweep stiff of nominal { vary elbow.servo.f_v = [2.58e295] N*m*s/rad; }\n"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert check(tmp_path, deck_of, select="stiff").plan is not None


def arms(joints: int, row: int) -> str:
    """Chains of `row` joints on a base that stands, all of one servo."""
    bars = [
        f"link bar_{i} {{ mass = {1 + i % 3} kg;  shape = rod(length = 0.2 m, along = x); }}\n"
        f"joint hinge_{i} revolute {{ parent = {'base' if i % row == 0 else f'bar_{i - 1}'};  child = bar_{i};"
        f"  axis = z;  at = [{0.2 if i % row else 0} m, 0 m, 0 m]; }}"
        for i in range(joints)
    ]
    _, _, tail = deck(2.0).partition("servo drive")
    servos = "  ".join(f"hinge_{i} = drive;" for i in range(joints))
    return "arm swing {\n" + "\n".join(bars) + "\n}\nservo drive" + tail.replace("hinge = drive;", servos)


@pytest.mark.parametrize("ticks", [True, False])
def test_chains_that_do_not_act_on_each_other_grow_as_the_whole_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ticks: bool
) -> None:
    sampled = Linearizer(experiment(tmp_path, arms(6, 2)), [0]).sampled()
    assert sampled is not None and uncoupled(sampled) == (sampled,)
    whole = np.sort(growths(sampled, np.array([0]), ticks=ticks))
    monkeypatch.setattr(servo_loops, "WHOLE", 1)
    parts = uncoupled(sampled)
    assert [part.states for part in parts] == [sampled.states // 3] * 3
    assert sorted(law.joint for part in parts for law in part.laws) == [f"hinge_{i}" for i in range(6)]
    of_parts = np.sort(growths(sampled, np.array([0]), ticks=ticks))
    moves = np.isfinite(whole) & (whole > -100.0)
    assert np.allclose(of_parts[moves], whole[moves], rtol=1e-6, atol=1e-6) and moves.sum() >= 6


def test_a_chain_is_one_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sampled = Linearizer(experiment(tmp_path, arms(4, 4)), [0]).sampled()
    monkeypatch.setattr(servo_loops, "WHOLE", 1)
    assert sampled is not None
    assert len(uncoupled(sampled)) == 1


@pytest.mark.parametrize(("ticks", "dynamics"), [(True, "50 Hz"), (True, "200 Hz"), (False, "50 Hz")])
def test_the_part_of_a_loop_in_a_mode_is_the_derivative_by_its_gain(tmp_path: Path, ticks: bool, dynamics: str) -> None:
    made = changed(arms(3, 3), ("dynamics = 10 kHz", f"dynamics = {dynamics}"), ("ki = 0 V/rad", "ki = 3 V/rad"))
    sampled = Linearizer(experiment(tmp_path, made), [0]).sampled()
    assert sampled is not None
    lanes = np.array([0])
    (values,) = spectrum(sampled, lanes, ticks=ticks)
    value = values[np.argmax(np.abs(values - ticks))]
    parts, slopes = parts_in(sampled, 0, None, complex(value), ticks=ticks), []
    for joint in parts:
        sides = [spectrum(sampled, lanes, {joint: 1.0 + d}, ticks=ticks)[0] for d in (-1e-4, 1e-4)]
        less, more = (side[np.argmin(np.abs(side - value))] for side in sides)
        slopes.append(abs(more - less))
    assert np.allclose(np.array(list(parts.values())) / max(parts.values()), np.array(slopes) / max(slopes), atol=1e-3)


def many(joints: int, eager: int) -> str:
    """A chain of one servo, but for one joint's, whose gain is too large."""
    text = changed(
        arms(joints, joints),
        ("kp = 2.0 V", "kp = 0.05 V"),
        ("dynamics = 10 kHz", "dynamics = 200 Hz"),
        (f"hinge_{eager} = drive;", f"hinge_{eager} = eager;"),
    )
    return changed(text, ("run hold", "servo eager like drive { kp = 12 V*s/rad; }\nrun hold"))


def test_of_many_loops_those_are_tried_that_matter_most(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The finding is that of all loops tried, from a number of spectra that does not depend on how many there are."""
    made = experiment(tmp_path, many(3, 1))
    counts: list[int] = []

    def counted(*given: object, **more: object) -> np.ndarray:
        counts[-1] += 1
        return spectrum(*given, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(blame, "spectrum", counted)
    counts.append(0)
    (all_tried,) = loops(made)
    monkeypatch.setattr(blame, "TRIED", 1)
    counts.append(0)
    (found,) = loops(made)
    assert found == all_tried and found.joints == ("hinge_1",) and counts[1] < counts[0]


def test_the_gain_that_fits_a_large_arm_is_found_coarsely_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = experiment(tmp_path, many(3, 1))
    (exact,) = loops(made)
    monkeypatch.setattr(blame, "WHOLE", 1)
    (coarse,) = loops(made)
    assert exact.gain is not None and coarse.gain is not None
    assert exact.gain / 1.06 < coarse.gain < 1.001 * exact.gain and coarse.joints == exact.joints == ("hinge_1",)
    monkeypatch.setattr(blame, "LARGEST_FITTED", 1)
    (unfitted,) = loops(made)
    assert unfitted.gain is not None and math.isnan(unfitted.gain) and unfitted.joints == exact.joints
    (warning,) = check(tmp_path, many(3, 1), select="all").diagnostics
    assert warning.help[0] == "how much of the gain is stable was not searched for: the arm is too large"
