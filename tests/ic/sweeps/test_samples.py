"""Sampled sweeps: designs and distributions, stored in the plan, the same for the same seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from ic.sweeps import designs
from met.plan import Experiment
from met.plan import file as plan_file
from tests.ic.small_decks import ARM, RUN, SERVO, check, codes, experiment, messages

KP = "drive.kp = uniform(1, 2) V*s/rad;"
MASS = "links.bar.mass = normal(20, 1) kg;"


def swept(folder: Path, body: str) -> Experiment:
    return experiment(folder, ARM, SERVO, RUN, f"sweep it of hold {{ {body} }}\n", select=["it"])


def drawn(folder: Path, body: str) -> list[np.ndarray]:
    return [coordinate.values for coordinate in swept(folder, body).cases.coordinates]


@pytest.mark.slow
@pytest.mark.parametrize(("distribution", "law"), [
    ("uniform(1, 3)", stats.uniform(1, 2)),
    ("normal(20, 1)", stats.norm(20, 1)),
    ("truncated(20, 1, 19, 22)", stats.truncnorm(-1, 2, loc=20, scale=1)),
    ("truncated(1, 100, 2, 3)", stats.truncnorm(0.01, 0.02, loc=1, scale=100)),
    ("loguniform(0.1, 10)", stats.loguniform(0.1, 10)),
])  # fmt: skip
@pytest.mark.parametrize("design", ["lhs", "sobol", "random"])
def test_a_sample_follows_its_distribution(tmp_path: Path, design: str, distribution: str, law) -> None:  # type: ignore[no-untyped-def]
    (values,) = drawn(tmp_path, f"sample {design}(512) {{ links.bar.mass = {distribution} kg; }}")
    assert len(np.unique(values)) == 512
    assert stats.kstest(values, law.cdf).pvalue > 1e-3


def test_a_latin_hypercube_has_one_value_in_each_part_of_each_range(tmp_path: Path) -> None:
    kp, mass = drawn(tmp_path, f"sample lhs(40) {{ {KP} {MASS} }}")
    assert sorted(np.floor((kp - 1) * 40).astype(int)) == list(range(40))
    assert sorted(np.floor(stats.norm(20, 1).cdf(mass) * 40).astype(int)) == list(range(40))
    assert abs(np.corrcoef(kp, mass)[0, 1]) < 0.5


def test_samples_are_in_the_unit_that_is_written_with_twelve_digits(tmp_path: Path) -> None:
    found = swept(tmp_path, "sample lhs(5) { links.bar.mass = uniform(100, 200) g; }").cases.coordinates[0]
    assert (found.unit, found.scale) == ("g", 1e-3)
    assert all(0.1 <= value <= 0.2 for value in found.values)
    assert all(float(f"{value / 1e-3:.12g}") * 1e-3 == value for value in found.values)
    (own,) = drawn(tmp_path, "sample lhs(5) { links.bar.mass = uniform(100 g, 0.2 kg); }")
    assert own.tolist() == found.values.tolist()


BOUNDED = [
    ("initial.hinge.q", ("deg", "arcmin", "arcsec", "cycle", "rad")),
    ("links.bar.mass", ("g", "kg", "t")),
    ("initial.hinge.qd", ("rpm", "deg/s", "cycle/min", "rad/h")),
    ("drive.v_max", ("mV", "kV")),
]


@pytest.mark.release
@pytest.mark.parametrize("seed", range(20))
def test_samples_stay_within_the_bounds_that_the_deck_writes_to_the_last_bit(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In any unit, with bounds of more digits than values have, and at the outermost points that a design may draw."""
    random = np.random.default_rng(seed)
    points = np.array([2.0**-54, 0.25, 0.5, 0.75, 1.0 - 2.0**-53])[:, np.newaxis]
    monkeypatch.setattr(designs, "_points", lambda *asked: points)
    path, named = BOUNDED[random.integers(len(BOUNDED))]
    unit, digits = random.choice(named), random.choice([1, 3, 12, 17])
    low = float(f"{random.uniform(1e-3, 500):.{digits}g}")
    high = float(f"{low * (1 + 10 ** random.uniform(-3, 1)):.17g}")
    wide = high - low
    mean, deviation = low + wide * random.uniform(-3, 4), wide * 10 ** random.uniform(-0.5, 3)
    kinds = {"uniform": [low, high], "loguniform": [low, high], "truncated": [mean, deviation, low, high]}
    for kind, numbers in kinds.items():
        behind = f"{kind}({', '.join(map(repr, map(float, numbers)))}) {unit}"
        inside = f"{kind}({', '.join(f'{float(x)!r} {unit}' for x in numbers)})"
        ends, values, same = (
            drawn(tmp_path, each)[0]
            for each in (
                f"vary {path} = [{low!r}, {high!r}] {unit};",
                f"sample random(5) {{ {path} = {behind}; }}",
                f"sample random(5) {{ {path} = {inside}; }}",
            )
        )
        assert ends[0] <= values.min() < values.max() <= ends[1], behind
        assert values.tolist() == same.tolist()


def test_the_seed_decides_and_stands_in_the_sweep_or_its_run(tmp_path: Path) -> None:
    body = f"sample lhs(5) {{ {KP} }}"
    first, same, other = (drawn(tmp_path, f"{seed} {body}")[0].tolist() for seed in ("", "seed = 0;", "seed = 1;"))
    assert first == same != other
    run = RUN.replace("duration", "seed = 1; duration")
    of_run = experiment(tmp_path, ARM, SERVO, run, f"sweep it of hold {{ {body} }}\n", select=["it"])
    assert of_run.cases.coordinates[0].values.tolist() == other


def test_two_samples_of_one_sweep_are_drawn_apart_and_multiply(tmp_path: Path) -> None:
    kp, mass = drawn(tmp_path, f"sample lhs(4) {{ {KP} }} sample lhs(3) {{ links.bar.mass = uniform(1, 2) kg; }}")
    assert len(kp) == 12
    assert len(np.unique(kp)) == 4
    assert not set(kp) & set(mass)


@pytest.mark.parametrize("design", ["sobol", "random"])
def test_more_samples_of_these_designs_change_no_old_case(tmp_path: Path, design: str) -> None:
    few = drawn(tmp_path, f"sample {design}(64) {{ {KP} {MASS} }}")
    many = drawn(tmp_path, f"sample {design}(128) {{ {KP} {MASS} }}")
    assert [column[:64].tolist() for column in many] == [column.tolist() for column in few]


def test_more_parameters_change_no_old_case_of_independent_draws(tmp_path: Path) -> None:
    few = drawn(tmp_path, f"sample random(64) {{ {KP} }}")
    many = drawn(tmp_path, f"sample random(64) {{ {MASS} {KP} }}")
    assert many[1].tolist() == few[0].tolist()


def test_a_latin_hypercube_says_that_it_cannot_be_extended(tmp_path: Path) -> None:
    notes = swept(tmp_path, f"sample lhs(5) {{ {KP} }}").notes
    assert "sample lhs(5), seed 0: another count would draw other values" in notes
    assert any(
        note == "sample sobol(4), seed 3" for note in swept(tmp_path, f"seed = 3; sample sobol(4) {{ {KP} }}").notes
    )


def test_the_plan_holds_what_was_drawn(tmp_path: Path) -> None:
    compiled = check(
        tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ sample lhs(5) {{ {KP} {MASS} }} }}\n", select=["it"]
    )
    assert compiled.plan is not None
    again = plan_file.loads(plan_file.dumps(compiled.plan))
    for one, other in zip(
        compiled.plan.experiments[0].cases.coordinates, again.experiments[0].cases.coordinates, strict=True
    ):
        assert one.values.tolist() == other.values.tolist()


def test_an_uneven_sobol_sequence_is_warned_of(tmp_path: Path) -> None:
    text = messages(
        check(tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ sample sobol(100) {{ {KP} }} }}\n", select=["it"])
    )
    assert (
        text
        == """\
warning[D228]: 100 points of a Sobol sequence are less even than 64 or 128
  --> deck.ic:18:33
   |
18 | sweep it of hold { sample sobol(100) { drive.kp = uniform(1, 2) V*s/rad; } }
   |                                 ^^^
   = help: take a power of 2

1 warning
"""
    )


def test_saltelli_mixes_two_points_one_parameter_after_the_other(tmp_path: Path) -> None:
    kp, mass = (each.reshape(8, 4) for each in drawn(tmp_path, f"sample saltelli(8) {{ {KP} {MASS} }}"))
    for values, mixed, kept in ((kp, 1, 2), (mass, 2, 1)):
        a, b = values[:, 0], values[:, 3]
        assert (values[:, mixed] == b).all() and (values[:, kept] == a).all()
        assert len(np.unique(values)) == 16, "no two points share a value"
    assert stats.kstest(kp[:, [0, 3]].ravel(), stats.uniform(1, 1).cdf).pvalue > 0.05
    notes = swept(tmp_path, f"sample saltelli(8) {{ {KP} {MASS} }}").notes
    assert "sample saltelli(8), seed 0: 8 times 4 cases" in notes


def test_more_of_saltelli_changes_no_old_case(tmp_path: Path) -> None:
    few = drawn(tmp_path, f"sample saltelli(8) {{ {KP} {MASS} }}")
    many = drawn(tmp_path, f"sample saltelli(16) {{ {KP} {MASS} }}")
    assert [column[:32].tolist() for column in many] == [column.tolist() for column in few]


def test_saltelli_of_one_parameter_is_refused(tmp_path: Path) -> None:
    text = messages(
        check(tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ sample saltelli(8) {{ {KP} }} }}\n", select=["it"])
    )
    assert (
        text
        == """\
error[D224]: `saltelli` shares a metric's variance out among parameters, and there is one
  --> deck.ic:18:27
   |
18 | sweep it of hold { sample saltelli(8) { drive.kp = uniform(1, 2) V*s/rad; } }
   |                           ^^^^^^^^
   = help: draw more of them, or write `sample random(N) { ... }`

1 error
"""
    )


def test_what_is_wrong_with_a_distribution_is_placed(tmp_path: Path) -> None:
    text = messages(
        check(
            tmp_path,
            ARM,
            SERVO,
            RUN,
            "sweep it of hold { sample lhs(3) { "
            "drive.kp = unifrom(1, 2) V*s/rad; drive.ki = normal(1, -1) V/rad; } }\n",
            select=["it"],
        )
    )
    assert (
        text
        == """\
error[D225]: `drive.kp` is drawn from a distribution
  --> deck.ic:18:47
   |
18 | sweep it of hold { sample lhs(3) { drive.kp = unifrom(1, 2) V*s/rad; drive.ki = normal(1, -1) V/rad; } }
   |                                               ^^^^^^^^^^^^^^^^^^^^^
   = help: did you mean `uniform`?
   = help: write `drive.kp = uniform(a, b) UNIT;`
   = help: distributions: uniform, loguniform, normal, truncated

error[D225]: a standard deviation is above 0
  --> deck.ic:18:91
   |
18 | sweep it of hold { sample lhs(3) { drive.kp = unifrom(1, 2) V*s/rad; drive.ki = normal(1, -1) V/rad; } }
   |                                                                                           ^^
   = help: a parameter that does not vary belongs in the run

2 errors
"""
    )


def test_a_sample_varies_twice_what_is_varied_already(tmp_path: Path) -> None:
    body = f"vary drive.kp = [1, 2] V*s/rad; sample lhs(3) {{ {KP} }}"
    assert codes(tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ {body} }}", select=["it"]) == ["D040"]


def test_a_saltelli_sample_of_too_few_points_is_warned_of_with_the_number_that_is_needed(tmp_path: Path) -> None:
    def said(points: int) -> str:
        sweep = f"sweep it of hold {{ sample saltelli({points}) {{ {KP} {MASS} }} }}\n"
        return messages(check(tmp_path, ARM, SERVO, RUN, sweep, select=["it"]))

    assert "warning[D228]: 32 points are too few for indices: 128 cases that say nothing of them\n" in said(
        32
    ) and "= help: take 64 or more, a power of 2; of some thousands the intervals are narrow\n" in said(32)
    assert "D228" not in said(64)


def test_a_word_like_until_shown_is_told_what_was_meant(tmp_path: Path) -> None:
    for words in ("untilshown, at_most = 100", "until_show"):
        compiled = check(
            tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ sample random({words}) {{ {KP} }} }}\n", select=["it"]
        )
        word = words.split(",")[0]
        text = messages(compiled)
        assert f"error[D224]: `{word}` is no number of samples\n" in text
        assert "= help: did you mean `until_shown`?\n" in text
