"""Case tables from CSV files; sweeps made of others; ranges; repeats."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from met.plan import Experiment, keys
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, messages


def from_file(
    folder: Path, table: str, body: str = 'from "cases.csv";', arm: str = ARM, *more: str
) -> tuple[Experiment, ...]:
    (folder / "cases.csv").write_text(table, encoding="utf-8")
    compiled = check(folder, arm, SERVO, *more, RUN, f"sweep it of hold {{ {body} }}\n", select=["it"])
    assert compiled.plan is not None, messages(compiled)
    return compiled.plan.experiments


def said_of_file(folder: Path, table: str) -> str:
    (folder / "cases.csv").write_text(table, encoding="utf-8")
    return messages(check(folder, ARM, SERVO, RUN, 'sweep it of hold { from "cases.csv"; }\n', select=["it"]))


def rows(run: Experiment) -> list[tuple[float, ...]]:
    return list(zip(*(coordinate.values.tolist() for coordinate in run.cases.coordinates), strict=True))


def test_a_file_is_one_axis_with_units_in_its_head(tmp_path: Path) -> None:
    (run,) = from_file(tmp_path, "drive.kp [V*s/rad], links.bar.mass [g]\n1, 500\n2, 1500\n")
    assert rows(run) == [(1.0, 0.5), (2.0, 1.5)]
    mass = run.cases.coordinates[1]
    assert (mass.unit, mass.scale, mass.sets) == ("g", 1e-3, ("links.bar.mass",))
    (run,) = from_file(tmp_path, "drive.kp [V*s/rad]\n1\n2\n", 'vary drive.ki = [3, 4] V/rad; from "cases.csv";')
    assert rows(run) == [(3, 1), (3, 2), (4, 1), (4, 2)]


def test_a_files_text_is_in_the_plans_sources(tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text("drive.kp [V*s/rad]\n1\n2\n", encoding="utf-8")
    compiled = check(tmp_path, ARM, SERVO, RUN, 'sweep it of hold { from "cases.csv"; }', select=["it"])
    assert compiled.plan is not None
    assert [Path(source.name).name for source in compiled.plan.sources] == ["deck.ic", "cases.csv"]


def test_words_of_a_file_choose(tmp_path: Path) -> None:
    brisk = "servo brisk like drive { kp = 0.3 V*s/rad; }\n"
    found = from_file(
        tmp_path, "hinge.servo, links.bar.mass [kg]\ndrive, 1\nbrisk, 2\ndrive, 3\n", 'from "cases.csv";', ARM, brisk
    )
    assert [each.name for each in found] == ["it.drive", "it.brisk"]
    assert [rows(each) for each in found] == [[(1.0,), (3.0,)], [(2.0,)]]
    assert [each.cases.table.tolist() for each in found] == [[0, 2], [1]]


def test_a_column_that_is_no_parameter_is_told_in_the_file(tmp_path: Path) -> None:
    assert (
        said_of_file(tmp_path, "drive.kp [V*s/rad], links.bar.mas [kg]\n1, 2\n")
        == """\
error[D128]: no parameter `links.bar.mas` in this run
 --> cases.csv:1:21
  |
1 | drive.kp [V*s/rad], links.bar.mas [kg]
  |                     ^^^^^^^^^^^^^^^^^^
  = help: did you mean `links.bar.mass`?

1 error
"""
    )


@pytest.mark.parametrize(("table", "message"), [
    ("drive.kp\n1\n", "error[D060]: `kp` of servo `drive` is in V*s/rad, and this is a bare number"),
    ("drive.kp [V]\n1\n", "error[D061]: `kp` of servo `drive` is in V*s/rad, and this is in V"),
    ("drive.kp [Vs]\n1\n", "error[D193]: `Vs` is not a unit"),
    ("drive.kp [V*s/rad]\nmany\n", "error[D194]: `many` is not a number"),
    ("hinge.servo\ndrive\n3\n", "error[D194]: `3` is no word"),
        ("drive kp [V*s/rad]\n1\n", "error[D223]: `drive kp` is no path of a run"),
    ("drive.kp [V*s/rad]\n", "error[D223]: `cases.csv` has no rows: no case is in it"),
    ("drive.kp [V*s/rad]\n1\n1\n", "error[D133]: values number 1 and 2 are the same"),
    ("drive.kp [V*s/rad], drive.kp [V*s/rad]\n1, 1\n", "error[D198]: column `drive.kp` is there twice"),
])  # fmt: skip
def test_what_is_wrong_with_a_file_is_told(tmp_path: Path, table: str, message: str) -> None:
    assert message in said_of_file(tmp_path, table)


# Ranges


@pytest.mark.slow
@pytest.mark.parametrize(("written", "numbers"), [
    ("(0.1 .. 0.5 by 0.1) V*s/rad", [0.1, 0.2, 0.3, 0.4, 0.5]),
    ("5 V*s/rad .. 3 V*s/rad by -0.5 V*s/rad", [5, 4.5, 4, 3.5, 3]),
    ("[1, 2 .. 4 by 1, 8] V*s/rad", [1, 2, 3, 4, 8]),
    ("[linspace(1, 2, 3), 7 .. 8 by 0.5] V*s/rad", [1, 1.5, 2, 7, 7.5, 8]),
    ("(1 .. 1 by 1) V*s/rad", [1]),
    ("(1/2 .. 3/2 by 1/2) V*s/rad", [0.5, 1, 1.5]),
])  # fmt: skip
def test_ranges(tmp_path: Path, written: str, numbers: list[float]) -> None:
    run = experiment(tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ vary drive.kp = {written}; }}", select=["it"])
    assert run.cases.coordinates[0].values.tolist() == numbers


def test_a_range_that_misses_its_end_says_where_it_would_end(tmp_path: Path) -> None:
    text = messages(
        check(tmp_path, ARM, SERVO, RUN, "sweep it of hold { vary drive.kp = (1 .. 2 by 0.3) V*s/rad; }", select=["it"])
    )
    assert (
        text
        == """\
error[D220]: the steps do not meet the end: they reach 1.9, and 2 is not a whole number of steps from the first
  --> deck.ic:18:42
   |
18 | sweep it of hold { vary drive.kp = (1 .. 2 by 0.3) V*s/rad; }
   |                                          ^
   = help: end where the steps do, or `linspace(from, to, count)`, whose ends are met

1 error
"""
    )


def test_a_unit_behind_a_range_is_for_all_of_it(tmp_path: Path) -> None:
    one, other = (
        check(tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ vary drive.kp = {values}; }}", select=["it"]).plan
        for values in ("1 .. 2 by 0.1 V*s/rad", "(1 .. 2 by 0.1) V*s/rad")
    )
    assert one is not None and other is not None
    assert keys.case_ids(one.experiments[0]) == keys.case_ids(other.experiments[0])


def test_only_bare_ends_take_the_unit_behind_a_range(tmp_path: Path) -> None:
    text = messages(
        check(tmp_path, ARM, SERVO, RUN, "sweep it of hold { vary drive.kp = 1 .. 2 m by 0.5 V*s/rad; }", select=["it"])
    )
    assert "error[D063]: a range from a pure number to m by V*s/rad" in text
    assert "= help: all three must be of one dimension" in text


# Sums

GAINS = "sweep gains of hold { vary drive.kp = [1, 2] V*s/rad; vary integrator = [rk4, midpoint]; }\n"
MASSES = "sweep masses of hold { vary links.bar.mass = [1, 3, 4] kg; }\n"


def summed(folder: Path, *more: str) -> tuple[Experiment, ...]:
    compiled = check(folder, ARM, SERVO, RUN, GAINS, MASSES, *more, select=["all_of_it"])
    assert compiled.plan is not None, messages(compiled)
    return compiled.plan.experiments


def test_a_sum_has_the_cases_of_its_parts_one_after_the_other(tmp_path: Path) -> None:
    found = summed(tmp_path, "sweep all_of_it = gains + masses + hold;")
    assert [each.name for each in found] == [
        "all_of_it.gains.rk4",
        "all_of_it.gains.midpoint",
        "all_of_it.masses",
        "all_of_it.hold",
    ]
    assert {each.name_in_deck for each in found} == {"all_of_it"}
    assert [each.cases.table.tolist() for each in found] == [[0, 2], [1, 3], [4, 5, 6], [7]]


def test_a_sum_may_be_of_sums_and_the_default(tmp_path: Path) -> None:
    more = "sweep some = masses + hold; default sweep all_of_it = gains + some;"
    assert [each.name for each in summed(tmp_path, more)][-1] == "all_of_it.some.hold"
    compiled = check(tmp_path, ARM, SERVO, RUN, GAINS, MASSES, more)
    assert compiled.plan is not None
    assert len(compiled.plan.experiments) == 4


@pytest.mark.slow
@pytest.mark.parametrize(("more", "message"), [
    ("sweep x = gains + nothing;", "error[D041]: no run or sweep `nothing`"),
    ("sweep x = gains + x;", "error[D043]: sweep `x` is made of itself"),
    ("sweep x = y + gains; sweep y = x + hold;", "error[D043]: sweep `x` is made of itself"),
    ("sweep x = gains + gains;", "error[D040]: `gains` is in this sweep twice"),
    ("sweep x = gains * 2;", "error[D120]: a sweep is made of runs and sweeps, with `+` between them"),
    ("sweep x = gains + drive.kp;", "error[D120]: a sweep is made of runs and sweeps"),
    ("sweep x += gains;", "error[D120]: a sweep made of others is `sweep NAME = ONE + OTHER;`"),
    ("sweep gains = masses + hold;", "error[D040]: sweep `gains` is written twice"),
    ("sweep more of hold { vary links.bar.mass = [3, 7] kg; } sweep x = masses + more;",
     "error[D227]: case #0 of `more` is in `masses` too"),
    ("sweep more of hold { vary links.bar.mass = [7, 3, 4] kg; } sweep x = masses + more;",
     "error[D227]: 2 cases of `more` are in `masses` too, the first is #1"),
])  # fmt: skip
def test_sums_that_cannot_be(tmp_path: Path, more: str, message: str) -> None:
    assert message in messages(check(tmp_path, ARM, SERVO, RUN, GAINS, MASSES, more, select="all"))


# Repeats

NOISY = changed(
    RUN, ("duration", "substitute hinge { bed = emulated(faults = typical); law = torque_balance; }\n    duration")
)


def noisy(folder: Path, body: str) -> Experiment:
    return experiment(folder, ARM, SERVO, NOISY, f"sweep it of hold {{ {body} }}", select=["it"])


def test_repeats_are_the_innermost_axis(tmp_path: Path) -> None:
    run = noisy(tmp_path, "repeat 3; vary hinge.servo.kp = [1, 2] V*s/rad;")
    assert run.cases.repeats is not None
    assert [*zip(run.cases.coordinates[0].values.tolist(), run.cases.repeats.tolist(), strict=True)] == [
        *itertools.product([1.0, 2.0], [0.0, 1.0, 2.0])
    ]


def test_a_run_alone_may_be_repeated(tmp_path: Path) -> None:
    run = noisy(tmp_path, "repeat 3;")
    assert (run.cases.count, run.cases.coordinates, run.varies) == (3, (), True)


def test_repeats_without_noise_are_an_error(tmp_path: Path) -> None:
    quiet = changed(NOISY, ("typical", "none"))
    assert codes(tmp_path, ARM, SERVO, quiet, "sweep it of hold { repeat 3; }", select=["it"]) == ["D230"]
    text = messages(check(tmp_path, ARM, SERVO, RUN, "sweep it of hold { repeat 3; }", select=["it"]))
    assert (
        text
        == """\
error[D230]: there is no noise in this run, so a repeat is the same case again
  --> deck.ic:18:20
   |
18 | sweep it of hold { repeat 3; }
   |                    ^^^^^^
   = help: leave `repeat` out
   = help: a sensor may be noisy: `sensor qd = tachometer { noise = 0.1 rad/s; }` in a servo
   = help: and so may a bed: `substitute JOINT { bed = emulated(faults = typical); }`

1 error
"""
    )


def test_seeds_may_be_independent(tmp_path: Path) -> None:
    run = noisy(tmp_path, "seeds = independent; vary hinge.servo.kp = [1, 2] V*s/rad;")
    assert run.cases.seeds == "independent"
