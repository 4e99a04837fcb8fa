"""The table of cases: which failed, which missed a requirement, and what a case is by itself."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries import cases, ordering
from batch.queries.ordering import CaseOrder, by_names
from batch.queries.pool import Pool
from batch.terminal.running import run_and_tell
from batch.terminal.show import as_json, show
from met.cli import main
from met.diagnostic import Problem
from met.plan import Experiment, keys
from met.plan import file as plan_file
from met.plan.judged import Requirement
from tests.batch import plans

pytestmark = pytest.mark.usefixtures("engine")


def required(experiment: Experiment, *requirements: Requirement) -> Experiment:
    return replace(experiment, requirements=requirements)


def alone(group: ArchiveGroup) -> Pool:
    return Pool(group.name, [group])


def made(experiment: Experiment, **options: Any) -> ArchiveFile:
    batch.run(plans.plan(experiment), output="a.h5", **options)
    return ArchiveFile("a.h5")


@pytest.mark.slow
def test_failed_cases_stand_before_those_that_miss_more_and_by_more(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from met import run

    monkeypatch.setattr(run, "run", partial(plans.answer, fails=frozenset({7, 12})))
    settle, volts = plans.gains(20).requirements
    with made(required(plans.gains(20), settle, replace(volts, text="volts < 6 V", limit=6.0))) as file:
        order = alone(file.groups[0]).worst_first.tolist()
        group = file.groups[0]
        missed, value = (group.values("met") == 0).sum(axis=1), group.values("volts")
    assert order[:2] == [7, 12]
    assert order[2] == 0  # its settling time is infinite
    counts = missed[order[2:]].tolist()
    assert counts == sorted(counts, reverse=True)
    missing = [row for row in order[3:] if missed[row]]
    assert len(missing) > 2
    assert value[missing].tolist() == sorted(value[missing], reverse=True)


@pytest.mark.slow
def test_where_all_requirements_are_met_the_closest_to_a_limit_is_first(here: Path) -> None:
    with made(required(plans.gains(9), Requirement("volts > 1 V", "volts", ">", 1.0))) as file:
        group = file.groups[0]
        order = alone(group).worst_first
        assert order[0] == np.argmin(group.values("volts"))
        assert cases.title(group) == "cases, closest to a limit first:"


@pytest.mark.slow
def test_of_cases_that_are_equally_bad_the_first_are_far_from_one_another(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tests.batch.report import archives

    archives.failing(monkeypatch, *range(90))
    with made(archives.grid([0.01 * n for n in range(1, 11)], [10.0 * n for n in range(1, 11)])) as file:
        group = file.groups[0]
        order = alone(group).worst_first.tolist()
        assert order[:4] == [0, 89, 9, 80]  # the corners of the 90 that fail: kp in tens, mass in ones
        assert sorted(order) == list(range(100)) and set(order[:90]) == set(range(90))
        assert order[cases.SHOWN_CASES : 90] == sorted(order[cases.SHOWN_CASES : 90])
        assert cases.title(group, 3) == "the 3 worst cases (90 are equally bad):"
        assert cases.title(group) == "cases, worst first (90 are equally bad):"
        assert cases.title(group, 90) == "the 90 worst cases:"


def test_a_limit_of_zero_has_an_order_too(here: Path) -> None:
    with made(required(plans.gains(9), Requirement("volts < 0 V", "volts", "<", 0.0))) as file:
        group = file.groups[0]
        assert alone(group).worst_first[0] == np.argmax(group.values("volts"))


@pytest.mark.slow
def test_without_requirements_the_order_is_the_tables(here: Path) -> None:
    with made(required(plans.gains(9))) as file:
        assert alone(file.groups[0]).worst_first.tolist() == list(range(9))
        assert cases.title(file.groups[0]) == "cases:"


@pytest.mark.release
@pytest.mark.parametrize("largest", [False, True])
@pytest.mark.parametrize("name", ["settle", "volts", "gearbox.kp"])
def test_by_a_metric_or_what_is_varied_and_without_a_value_last(
    here: Path, monkeypatch: pytest.MonkeyPatch, name: str, largest: bool
) -> None:
    from met import run

    monkeypatch.setattr(run, "run", partial(plans.answer, fails=frozenset({7, 12})))
    with made(plans.gains(20)) as file:
        group = file.groups[0]
        order = ordering.places(alone(group), CaseOrder(name, largest)).tolist()
        [variable] = [v for v in (*group.role("metric"), *group.role("coordinate")) if v.path == name]
        values = group.values(variable.name)
        said = json.loads(as_json(file, by=CaseOrder(name, largest), all_cases=True))["experiments"][0]["case_table"]
        lines = show(file, by=CaseOrder(name, largest)).splitlines()
    assert sorted(order) == list(range(20)) == sorted(each["row"] for each in said)
    assert [each["row"] for each in said] == order
    known = [row for row in order if not np.isnan(values[row])]
    sign = -1.0 if largest else 1.0
    assert order[: len(known)] == known == sorted(known, key=lambda row: (sign * values[row], row))
    assert order[len(known) :] == ([] if name == "gearbox.kp" else [7, 12])
    title = lines.index(f"cases by {name}, {'largest' if largest else 'smallest'} first:")
    assert [line.split()[0] for line in lines[title + 3 :]] == [f"#{row}" for row in order]


@pytest.mark.slow
def test_by_several_each_its_own_way_round(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from met import run

    monkeypatch.setattr(run, "run", partial(plans.answer, fails=frozenset({7, 12})))
    with made(plans.gains(20)) as file:
        group = file.groups[0]
        by = by_names(["links.lower.mass", "volts:smallest"], reverse=True)
        assert by is not None
        order = ordering.places(alone(group), by).tolist()
        mass, volts = group.values("links.lower.mass"), group.values("volts")
        text = show(file, by=by, all_cases=True)
    assert len(set(mass.tolist())) < 20, "no two are equal in the first"
    rank = np.where(np.isnan(volts), np.inf, volts)
    assert order == sorted(range(20), key=lambda row: (-mass[row], rank[row], row))
    assert "cases by links.lower.mass, largest first; then by volts, smallest first:\n" in text


def test_which_way_round_is_said_of_each_or_of_all() -> None:
    def ways(*names: str, reverse: bool = False) -> list[bool]:
        found = by_names(names, reverse=reverse)
        return [] if found is None else [key.largest for key in found.keys]

    assert ways() == []
    assert ways("a", "b:largest", "c:smallest") == [False, True, False]
    assert ways("a", "b:largest", "c:smallest", reverse=True) == [True, True, False]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["volts:up"],
            "error[E329]: `volts:up` is no order of cases: `up` is neither largest nor smallest\n"
            " = help: `--sort volts:largest`, or `--sort volts:smallest`\n\n1 error\n",
        ),
        (
            ["volts", "volts:largest"],
            "error[E329]: cases are to be listed by `volts` twice\n = help: leave one out\n\n1 error\n",
        ),
        (
            ["volts:largest,settle"],
            "error[E329]: no metric or varied parameter `volts:largest,settle`\n"
            " = help: one name each: `--sort volts:largest --sort settle`\n\n1 error\n",
        ),
        (
            ["settle,volts"],
            "error[E329]: no metric or varied parameter `settle,volts`\n"
            " = help: one name each: `--sort settle --sort volts`\n\n1 error\n",
        ),
        (
            ["volts", "vlts"],
            "error[E329]: no metric or varied parameter `vlts`\n"
            " = help: did you mean `volts`?\n"
            " = help: here: settle, volts, gearbox.kp, links.lower.mass\n\n1 error\n",
        ),
    ],
)
def test_an_order_that_is_none_is_told(
    here: Path, engine: None, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    capsys.readouterr()
    assert main(["show", "a.h5", *(each for word in words for each in ("--sort", word))]) == 2
    assert capsys.readouterr().err == said


@pytest.mark.slow
def test_what_cases_cannot_be_listed_by_is_told(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def told(*words: str) -> str:
        assert main(["show", "a.h5", *words]) == 2
        return capsys.readouterr().err

    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    assert told("--sort", "vlts") == (
        "error[E329]: no metric or varied parameter `vlts`\n"
        " = help: did you mean `volts`?\n"
        " = help: here: settle, volts, gearbox.kp, links.lower.mass\n"
        "\n1 error\n"
    )
    assert "--sort is of many cases, and --case of one" in told("--sort", "volts", "--case", "#0")
    assert "--reverse is of --sort" in told("--reverse")
    batch.run(plans.plan(plans.nominal()), output="a.h5", fresh=True)
    assert told("--sort", "volts") == (
        "error[E329]: `nominal` is one case: there is nothing to list by `volts`\n"
        " = help: a sweep has several\n"
        "\n1 error\n"
    )


@pytest.mark.slow
def test_the_table_is_in_the_decks_units_and_marks_what_is_missed(here: Path) -> None:
    settle = Requirement("settle < 8600 ms", "settle", "<", 8.6)
    ids = keys.case_ids(required(plans.gains(4), settle))
    with made(required(plans.gains(4), settle)) as file:
        lines = show(file).splitlines()
    assert lines[lines.index("cases, worst first:") :] == [
        "cases, worst first:",
        "      id        gearbox.kp  links.lower.mass  settle    volts",
        "                   V·s/rad                 g      ms        V",
        f"  #0  {ids[0][:8]}        0.01             20000     inf ✗  6.849  missed",
        f"  #1  {ids[1][:8]}        0.02             20100    5000    5.758  met",
        f"  #2  {ids[2][:8]}        0.03             20200    3333    5.334  met",
        f"  #3  {ids[3][:8]}        0.04             20000    2500    5.156  met",
    ]
    assert "  settle   2500    3333   5000 ms  settling_time of shoulder.qd; infinite in 1" in lines


def test_smallest_median_and_largest_are_of_the_finite_values_everywhere() -> None:
    from batch.queries.summary import MetricSpread, median_text, spread

    values = np.array([3.0, np.inf, 1.0, np.nan, 2.5, np.inf, np.inf])
    assert spread(values) == MetricSpread(minimum=1.0, median=2.5, maximum=3.0, infinite=3, unknown=1)
    assert spread(values[:3]).median == 2.0
    assert np.isnan(spread(values[1::4]).median)
    texts = [median_text(each) for each in (values, values[[0, 2]], values[[1, 3]], values[[3]])]
    assert texts == ["2.5, 3 inf", "2", "inf", "-"]


@pytest.mark.slow
def test_a_pure_number_has_no_unit_and_may_be_in_per_cent(here: Path) -> None:
    from batch.queries.summary import summary_of

    experiment = plans.nominal()
    over = replace(experiment.structure.metrics[0], name="settle", model="overshoot")
    structure = replace(experiment.structure, metrics=(over,))
    for limit, shown in (("settle < 1000 %", "500 %"), ("settle < 10", "5")):
        requirement = Requirement(limit, "settle", "<", 10.0)
        with made(replace(experiment, structure=structure, requirements=(requirement,))) as file:
            lines = show(file).splitlines()
            assert summary_of(file.groups[0]).metrics[0].median == 5.0
        value, _, unit = shown.partition(" ")
        said = f"settle {value} ± 0 {unit}".rstrip()
        assert f"{said} overshoot of shoulder.qd" in [" ".join(line.split()) for line in lines]


@pytest.mark.slow
def test_the_worst_twenty_are_shown_and_all_on_demand(here: Path) -> None:
    with made(plans.gains(30)) as file:
        some, whole = (show(file, all_cases=every).splitlines() for every in (False, True))
        assert some[-1] == "  ... 10 more; --all-cases prints them"
        assert sum("missed" in line.split() for line in some) == 20
        assert len(whole) == len(some) + 9
        for every, count in ((False, 20), (True, 30)):
            [said] = json.loads(as_json(file, all_cases=every))["experiments"]
            assert len(said["case_table"]) == count
            assert said["cases"] == 30


@pytest.mark.slow
def test_json_says_of_each_case_what_it_met(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from met import run

    monkeypatch.setattr(run, "run", partial(plans.answer, fails=frozenset({2})))
    with made(plans.gains(4)) as file:
        [said] = json.loads(as_json(file))["experiments"]
    failed, infinite, *_ = said["case_table"]
    assert (failed["row"], failed["status"]) == (2, "failed")
    assert failed["cause"].startswith("t = 0.2 s: joint elbow")
    assert failed["met"] == {"settle < 10 s": None, "volts < 5 V": None}
    assert infinite["metrics"]["settle"] is None
    assert infinite["met"] == {"settle < 10 s": False, "volts < 5 V": False}
    assert infinite["coordinates"] == {"gearbox.kp": 0.01, "links.lower.mass": 20.0}


@pytest.mark.slow
def test_one_case_has_its_own_metrics_and_parameters(here: Path) -> None:
    with made(plans.gains(4)) as file:
        text = show(file, case="#1")
        [said] = json.loads(as_json(file, case="#1"))["experiments"]
        count = len(file.plan().experiments[0].parameters)
    about = text[text.index("case #1") : text.index("\n\n" + 20 * " ")]  # up to the ranges of its signals
    assert about.splitlines() == [
        f"case #1 {keys.case_ids(plans.gains(4))[1][:8]}",
        "the case reached its end",
        "  settle      5 s  settling_time of shoulder.qd",
        "  volts   5.758 V  max of shoulder.servo.voltage",
        "  require settle < 10 s  met",
        "  require volts < 5 V    missed",
        "",
        "varied, and what follows from it:",
        "  gearbox.kp              0.02 V·s/rad",
        "  links.lower.mass        20100 g",
        "  elbow.servo.kp          0.02 V·s/rad",
        "  links.lower.inertia.yy  6.7 kg·m²",
        "  links.lower.inertia.zz  6.7 kg·m²",
        "  shoulder.servo.kp       0.02 V·s/rad",
        f"  of {count} parameters; --format json lists them all",
    ]
    assert said["case"]["met"] == {"settle < 10 s": True, "volts < 5 V": False}
    assert len(said["case"]["parameters"]) == count
    mass = said["case"]["parameters"]["links.lower.mass"]
    assert mass == {"value": pytest.approx(20.1, rel=1e-15), "unit": "kg", "varies": True}


@pytest.mark.slow
def test_a_case_is_shown_of_the_experiments_that_have_it(here: Path) -> None:
    batch.run(plans.plan(plans.nominal(), plans.gains(4)), output="a.h5")
    with ArchiveFile("a.h5") as file:
        text = show(file, case="#3")
        assert "gains  4 cases" in text and "nominal  1 case" not in text
        with pytest.raises(Problem) as caught:
            show(file, case="#4")
    assert [d.help for d in caught.value.diagnostics] == [
        ("the only case here is #0",),
        ("cases here: #0 to #3; or the beginning of a case_id",),
    ]


@pytest.mark.slow
def test_cases_that_are_some_of_a_table_are_named(here: Path) -> None:
    with made(plans.gains(9), cases=["#2", "#7"]) as file, pytest.raises(Problem) as caught:
        show(file, case="#3")
    assert caught.value.diagnostics[0].help == ("cases here: #2, #7; or the beginning of a case_id",)


@pytest.mark.slow
def test_few_values_are_read_by_themselves_and_many_at_once(here: Path) -> None:
    with made(plans.gains(250)) as file:
        group = file.groups[0]
        for positions in (np.array([7, 3]), np.arange(249, -1, -1)):
            for name in ("case", "case_id", "volts", "met"):
                np.testing.assert_array_equal(group.at(name, positions), group.values(name)[positions])


@pytest.mark.slow
def test_an_archive_that_does_not_say_its_limits_has_a_table_all_the_same(here: Path) -> None:
    import h5py

    with made(plans.gains(4)):
        pass
    with h5py.File("a.h5", "r+") as file:
        del file["requirement"].attrs["limit"]
    with ArchiveFile("a.h5") as file:
        text = show(file)
    assert text.count("  missed\n") == 4


@pytest.mark.slow
def test_a_run_of_a_sweep_ends_with_its_worst_cases(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan_file.write(plans.plan(plans.gains(20)), here / "p.json")
    run_and_tell("p.json", no_picture=True)
    said = capsys.readouterr().out.splitlines()
    at = said.index("the 3 worst cases:")
    assert [line.split()[0] for line in said[at + 3 : at + 6]] == ["#0", "#1", "#2"]
    assert "         met show two_link.h5 --case '#0'" in said
    run_and_tell("p.json", json=True, no_picture=True)
    [told] = json.loads(capsys.readouterr().out)["experiments"]
    assert [row["row"] for row in told["worst"]] == [0, 1, 2]


def test_a_sweep_that_nothing_judges_names_no_worst_case(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan_file.write(plans.plan(required(plans.gains(20))), here / "p.json")
    assert run_and_tell("p.json", no_picture=True)
    said = capsys.readouterr().out
    assert "worst" not in said and "--case" not in said
