"""`met run --rows`: an archive with a summary of its cases and few rows says what one with a row a case says, has the
same bytes whoever ran it, and any of its cases is computed again."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.archive.summarised import NAME
from batch.campaigns import drive, keep, merge, performing, tasks
from batch.queries import tallies
from batch.queries.evidence import EvidenceRow, evidence_for
from batch.queries.requirements import group_requirements
from batch.queries.summary import SummedMetric, summarise
from met.plan import Plan
from tests.batch.foreign.archives import changed, met

DECK = """
#include <two_link.ic>
run short like nominal {
    duration = 4 s;
    rates { dynamics = 50 Hz; servos = 100 Hz; record = 5 Hz; }
    require quick: settle < 3 s in 90 % of cases with 90 % confidence;
    require calm: volts < 4.9 V;
    require most: volts < 5 V in 80 % of cases;
    require percentile(volts, 95 %) < 5.2 V with 90 % confidence;
    require percentile(settle, 5 %) > 3 s with 90 % confidence;
    allow D341 because "what does not settle is part of it";
}
run bench like short { substitute shoulder { bed = emulated(faults = typical);  law = velocity_tracking; } }
sweep many of short {
    vary gearbox.kp = [0.01, 0.02] V*s/rad;
    vary gearbox.ki = [0.06, 0.125] V/rad;
    sample random(150) { gearbox.kt = normal(0.1, 0.003) N*m/A; }
}
sweep wild of short {
    vary initial.shoulder.qd = [0, 1e120] rad/s;  // the last is too much for its square
    sample random(60) { gearbox.kt = normal(0.1, 0.003) N*m/A; }
}
sweep listed of short { vary gearbox.kp = linspace(0.01, 0.03, 30) V*s/rad; }
sweep noisy of bench { repeat 12; }
sweep ways of short {
    vary integrator = [modified_euler, rk4];
    sample random(60) { gearbox.kt = normal(0.1, 0.003) N*m/A; }
}
"""
SWEEPS = (
    "many",
    "wild",
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("listed", "noisy", "ways")),
)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the deck and the archives of `many`; and those that `archives` makes later."""
    folder = tmp_path_factory.mktemp("summaries")
    (folder / "d.ic").write_text(DECK, encoding="utf-8")
    with contextlib.chdir(folder):
        archives("many")
    return folder


@pytest.fixture
def here(place: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(place)
    return place


def archives(name: str) -> None:
    """Make NAME.rows.h5 of a sweep, with a row a case, and NAME.summary.h5, once."""
    if not Path(f"{name}.summary.h5").exists():
        batch.run(plan_of(name), output=f"{name}.rows.h5", histories="none", verify="some")
        batch.run(plan_of(name), output=f"{name}.summary.h5", rows="summary", verify="some")


def plan_of(name: str) -> Plan:
    return ic.compile("d.ic", select=[name])


def judged(file: ArchiveFile) -> list[tuple[EvidenceRow, int]]:
    """All rows of evidence, each with its worst case."""
    return [
        (row, int(group.values("case")[row.worst]))
        for group in file.groups
        for row in evidence_for(group, group_requirements(group))
    ]


@pytest.mark.release
@pytest.mark.parametrize("name", SWEEPS)
def test_its_evidence_is_that_of_all_rows(here: Path, name: str) -> None:
    archives(name)
    with ArchiveFile(f"{name}.rows.h5") as rows, ArchiveFile(f"{name}.summary.h5") as summary:
        whole, summed = judged(rows), judged(summary)
    assert len(whole) == len(summed) >= 6
    for (one, case), (other, same) in zip(whole, summed, strict=True):
        a, b = dataclasses.asdict(one), dataclasses.asdict(other)
        assert a.pop("worst") is not None and b.pop("worst") is not None
        assert case == same, one
        for figures in (a, b):  # means and deviations are summed another way: rounding
            figures["sigmas"] = None if figures["sigmas"] is None else pytest.approx(figures["sigmas"], rel=1e-9)
        assert repr(a.pop("value")) == repr(b.pop("value")) and repr(a.pop("margin")) == repr(b.pop("margin"))
        assert a == b


@pytest.mark.release
@pytest.mark.parametrize("name", SWEEPS)
def test_its_outcome_is_that_of_all_rows(here: Path, name: str) -> None:
    archives(name)
    with ArchiveFile(f"{name}.rows.h5") as rows, ArchiveFile(f"{name}.summary.h5") as summary:
        for one, other, group in zip(summarise(rows), summarise(summary), rows.groups, strict=True):
            assert (one.cases, one.failed, one.ok) == (other.cases, other.failed, other.ok)
            assert [dataclasses.replace(each, evidence=()) for each in one.requirements] == [
                dataclasses.replace(each, evidence=()) for each in other.requirements
            ]
            assert one.step_errors == other.step_errors
            assert [(each.status, each.cause, each.case_id, each.row, each.count) for each in one.failures] == [
                (each.status, each.cause, each.case_id, each.row, each.count) for each in other.failures
            ]
            for a, b in zip(one.metrics, other.metrics, strict=True):
                assert isinstance(b, SummedMetric)
                same = ("minimum", "maximum", "infinite", "unknown", "name", "unit", "deck_unit", "deck_scale")
                assert all(repr(getattr(a, field)) == repr(getattr(b, field)) for field in same)
                values = group.values(a.name)
                finite = values[np.isfinite(values)]
                assert b.mean == pytest.approx(finite.mean(), rel=1e-14)
                assert b.deviation == pytest.approx(finite.std(ddof=1), rel=1e-9)
                assert b.least_case == group.values("case")[np.where(np.isfinite(values), values, np.inf).argmin()]
                assert b.most_case == group.values("case")[np.where(np.isfinite(values), values, -np.inf).argmax()]


@pytest.mark.slow
def test_verified_cases_are_those_of_all_rows(here: Path) -> None:
    with ArchiveFile("many.rows.h5") as rows, ArchiveFile("many.summary.h5") as summary:
        one, other = rows.groups[0].verified, summary.groups[0].verified
    assert one is not None and other is not None
    np.testing.assert_array_equal(one.cases, other.cases)
    np.testing.assert_array_equal(one.half, other.half)


@pytest.mark.slow
def test_cases_fail_in_these(here: Path) -> None:
    """Else nothing is shown of causes."""
    archives("wild")
    with ArchiveFile("wild.rows.h5") as file:
        (found,) = summarise(file)
    assert 0 < found.failed < found.cases


@pytest.mark.release
@pytest.mark.parametrize("more", [{"threads": 1}, pytest.param({"processes": 2}, marks=pytest.mark.slow)])
def test_its_bytes_are_the_same_whoever_ran_it(
    here: Path, more: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks, "MOST_CASES", 17)
    monkeypatch.setattr(tasks, "GRANULE", 1)
    monkeypatch.setattr(drive, "GRANULE", 1)
    batch.run(plan_of("many"), output="again.h5", rows="summary", verify="some", fresh=True, **more)
    assert Path("again.h5").read_bytes() == Path("many.summary.h5").read_bytes()


@pytest.mark.slow
def test_its_bytes_are_the_same_where_it_was_interrupted_as_it_was_summed_up(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(performing, "WORTH_SECONDS", 0.0)
        patch.setattr(performing, "summarise", interrupted)
        with pytest.raises(KeyboardInterrupt):
            batch.run(plan_of("many"), output="resumed.h5", rows="summary", verify="some")
    assert Path("resumed.h5.campaign").is_dir()
    done = batch.run(plan_of("many"), output="resumed.h5", rows="summary", verify="some")
    assert any("600 cases are done" in note or "600 of 600 cases are done" in note for note in done.notes)
    assert Path("resumed.h5").read_bytes() == Path("many.summary.h5").read_bytes()


@pytest.mark.slow
def test_cases_in_several_blocks_give_the_same_but_for_rounding(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(merge, "BLOCK", 64)
    batch.run(plan_of("many"), output="blocks.h5", rows="summary", verify="some")
    with ArchiveFile("blocks.h5") as one, ArchiveFile("many.summary.h5") as other:
        a, b = one.groups[0].summary, other.groups[0].summary
        assert a is not None and b is not None
        assert a.cases == b.cases == 600
        for name in a.values:
            if a.values[name].dtype.kind == "f":
                np.testing.assert_allclose(a.values[name], b.values[name], rtol=1e-12, err_msg=name)
            else:
                np.testing.assert_array_equal(a.values[name], b.values[name], err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("metric", ["volts", pytest.param("settle", marks=pytest.mark.slow)])
def test_worst_keeps_the_rows_of_the_worst(here: Path, metric: str) -> None:
    batch.run(plan_of("many"), output=f"{metric}.h5", rows=f"worst:12:{metric}", verify="none")
    with ArchiveFile("many.rows.h5") as rows, ArchiveFile(f"{metric}.h5") as some:
        all_rows, kept = rows.groups[0], some.groups[0]
        worst = np.argsort(-all_rows.values(metric), kind="stable")[:12]
        assert set(worst.tolist()) <= set(kept.values("case").tolist())
        assert kept.count < 60 and kept.run == 600
        places = kept.values("case")
        for name in ("case_id", "case_key", "gearbox.kt", "settle", "volts", "status", "met"):
            np.testing.assert_array_equal(kept.values(name), all_rows.values(name)[places])


@pytest.mark.slow
def test_a_case_that_it_names_is_computed_again_with_its_history(here: Path) -> None:
    with ArchiveFile("many.summary.h5") as file:
        case = int(file.groups[0].values("case")[3])
    said = met("run", "many.summary.h5", "--case", f"#{case}", "-o", "one.h5", "--no-picture")
    assert "the same bits as in many.summary.h5" in said.text
    with ArchiveFile("one.h5") as file:
        assert file.groups[0].recorded == 1 and file.groups[0].values("case").tolist() == [case]


@pytest.mark.slow
def test_any_other_case_is_computed_from_its_plan(here: Path) -> None:
    with ArchiveFile("many.summary.h5") as file:
        other = next(case for case in range(600) if case not in file.groups[0].values("case"))
    said = met("run", "many.summary.h5", "--case", f"#{other}", "-o", "other.h5", "--no-picture")
    assert "many.summary.h5 keeps a summary, without a row of it to compare with" in said.text
    with ArchiveFile("other.h5") as one, ArchiveFile("many.rows.h5") as rows:
        assert one.groups[0].values("volts")[0] == rows.groups[0].values("volts")[other]


@pytest.mark.slow
def test_a_case_without_a_row_is_told_with_the_command_that_runs_it(here: Path) -> None:
    with ArchiveFile("many.summary.h5") as file:
        other = next(case for case in range(600) if case not in file.groups[0].values("case"))
    said = met("show", "many.summary.h5", "--case", f"#{other}")
    remedy = f" = help: rows of few cases are kept: `met run many.summary.h5 --case '#{other}'` runs it again\n"
    assert said.status == 2 and f"error[E321]: no case `#{other}` in `many`\n = help: cases here: " in said.text
    assert remedy in said.text
    assert "runs it again" not in met("show", "many.summary.h5", "--case", "#600").text
    assert "runs it again" not in met("show", "many.rows.h5", "--case", "#600").text


@pytest.mark.slow
def test_met_show_says_that_it_is_a_summary(here: Path) -> None:
    archives("wild")
    said = met("show", "wild.summary.h5").text
    assert "wild  120 cases, 4 s" in said
    assert "a summary of them, and the rows of " in said
    assert "min" in said and "mean" in said and "sigma" in said and "median" not in said
    assert "of the rows that are kept, cases, worst first" in said


COMMANDS = (
    ("a report", ("report", "many.summary.h5")),
    ("a picture of all cases", ("plot", "many.summary.h5")),
    ("a comparison of cases", ("diff", "many.rows.h5", "many.summary.h5")),
    ("choosing among designs", ("best", "many.summary.h5")),
    ("what a result depends on", ("sensitivity", "many.summary.h5")),
    ("a table of all cases", ("export", "many.summary.h5", "-o", "t.csv")),
    ("a choice or an order of all cases", ("show", "many.summary.h5", "--sort", "volts")),
    ("a choice or an order of all cases", ("show", "many.summary.h5", "--met", "--format", "json")),
    ("running all again, or all that failed,", ("run", "many.summary.h5", "--failed")),
    ("running all again, or all that failed,", ("run", "many.summary.h5", "--all")),
)


@pytest.mark.slow
@pytest.mark.parametrize(("what", "command"), COMMANDS, ids=[" ".join(words) for _, words in COMMANDS])
def test_what_needs_a_row_a_case_is_refused_with_the_remedy(here: Path, what: str, command: tuple[str, ...]) -> None:
    said = met(*command)
    assert said.status == 2
    assert f"{what} needs a row a case, and many.summary.h5 keeps a summary of `many`" in said.text
    assert "`met run DECK --rows all` keeps a row a case, and `--rows worst:N:METRIC` a summary" in said.text


@pytest.mark.release
@pytest.mark.parametrize("name", ["many", pytest.param("ways", marks=pytest.mark.slow)])
def test_python_is_warned_that_its_rows_are_no_sample(here: Path, name: str) -> None:
    archives(name)
    with pytest.warns(UserWarning) as told:
        data = batch.open(f"{name}.summary.h5")
    nodes = [data] if name == "many" else data.children.values()
    parts = [part for part in nodes if "experiment" in part.attrs]
    assert sum(part.attrs["summary_of_cases"] for part in parts) == {"many": 600, "ways": 120}[name]
    assert [str(each.message) for each in told] == [
        f"{name}.summary.h5 keeps a summary of {part.attrs['summary_of_cases']:,} cases of `{part.attrs['experiment']}`"
        f", and the rows of {part.sizes['case']:,} that it names: these are no sample of them; `data.met.evidence()` "
        "judges all"
        for part in parts
    ]
    said = repr(parts[0].met)
    assert "no sample of them" in said and "met by" not in said
    assert "summary_of_cases" not in batch.open(f"{name}.rows.h5").attrs


def test_its_evidence_is_exported(here: Path) -> None:
    for kind in ("rows", "summary"):
        assert met("export", f"many.{kind}.h5", "--evidence", "-o", f"{kind}.csv").status == 0
    rows, summary = (Path(f"{kind}.csv").read_text(encoding="utf-8").splitlines() for kind in ("rows", "summary"))
    # three lines of heads; two requirements of every case; four of a share at four design points
    assert len(rows) == len(summary) == 3 + 2 + 4 * 4


REFUSED = {
    "sumary": "error[E351]: rows `sumary` is none of the words that say whose rows are kept\n"
    " = help: did you mean `summary`?\n = help: rows are kept of: all, summary, worst:N, or worst:N:METRIC, N up to "
    "100,000",
    "worst:0": "error[E351]: rows `worst:0` is none of the words that say whose rows are kept",
    "worst:3:volt": "error[E351]: no metric `volt` by which cases could be the worst\n = help: did you mean `volts`?",
}


@pytest.mark.slow
@pytest.mark.parametrize("word", REFUSED)
def test_a_word_that_is_none_is_refused(here: Path, word: str) -> None:
    said = met("run", "d.ic", "many", "-o", "none.h5", "--rows", word)
    assert said.status == 2 and REFUSED[word] in said.text
    assert not Path("none.h5").exists()


@pytest.mark.slow
def test_histories_all_verified_and_stopping_early_do_not_go_with_it(here: Path) -> None:
    def said(*words: str) -> str:
        return met("run", "d.ic", "many", "-o", "none.h5", "--rows", "summary", *words).text

    assert "error[E351]: rows `summary` keep no histories\n" in said("--histories", "all")
    assert "error[E351]: rows `summary` do not go with all cases verified" in said("--verify", "all")
    sample = "sample random(until_shown, at_most = 200) { gearbox.kt = normal(0.1, 0.003) N*m/A; }"
    Path("early.ic").write_text(f"{DECK}sweep early of short {{ {sample} }}\n", encoding="utf-8")
    said_early = met("run", "early.ic", "early", "-o", "none.h5", "--rows", "summary")
    assert "error[E351]: `early` stops when its requirements are decided, which takes a row a case" in said_early.text


def test_too_many_design_points_are_refused_beforehand(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (tallies, keep):
        monkeypatch.setattr(module, "MOST_POINTS", 3)
    said = met("run", "d.ic", "many", "-o", "none.h5", "--rows", "summary")
    assert "error[E351]: a summary has 3 design points at most, and this sweep has more" in said.text
    assert not Path("none.h5").exists() and not Path("none.h5.campaign").exists()


UNSOUND = {
    "a count of more cases than there are": ("judged_missed", 0, 601),
    "a count below 0": ("finite", 0, -1),
    "a case without a row": ("judged_worst_case", 0, 7),
    "a requirement that is none": ("judged_requirement", 0, 99),
    "a design point that is none": ("judged_point", 3, 4),
    "a row of no case": ("judged_cases", 0, 0),
    "more that miss or are unknown than a row has": ("judged_unknown", 0, 600),
    "more without a value than are unknown": ("judged_no_value", 0, 600),
    "a requirement with two rows of all cases": ("judged_requirement", 0, 1),
    "a row of a design point with other cases": ("judged_cases", -1, 149),
    "numbers of rows that are not theirs": ("judged", 0, 1 << 62),
    "numbers of points that are not theirs": ("point", 0, -1),
    "cases that a metric does not count": ("finite", 0, 0),
    "a mean that is no number": ("mean", 0, math.nan),
    "a mean that is infinite": ("mean", 0, math.inf),
    "a mean beyond the largest value": ("mean", 0, 1e9),
    "a variance that is no number": ("variance", 0, math.nan),
    "a variance that is infinite": ("variance", 0, math.inf),
    "a variance below 0": ("variance", 0, -1.0),
    "a least value above the largest": ("least", 0, 1e9),
    "a largest value that is no number": ("most", 0, math.nan),
    "a mean of a requirement that is infinite": ("judged_mean", 0, math.inf),
    "a deviation of a requirement below 0": ("judged_deviation", 0, -1.0),
}


@pytest.mark.release
@pytest.mark.parametrize("what", UNSOUND)
def test_a_forged_summary_is_told(here: Path, tmp_path: Path, what: str) -> None:
    name, place, value = UNSOUND[what]
    with ArchiveFile("many.summary.h5") as file:
        assert 7 not in file.groups[0].values("case")
    with changed(Path("many.summary.h5"), tmp_path) as (copy, file):
        file[f"{NAME}/{name}"][place] = value
    said = met("show", str(copy), "--evidence")
    assert said.status == 2 and "error[E302]" in said.text and NAME in said.text


@pytest.mark.slow
def test_numbers_that_are_forged_are_only_shown(here: Path, tmp_path: Path) -> None:
    with changed(Path("many.summary.h5"), tmp_path) as (copy, file):
        file[f"{NAME}/judged_mean"][:] = 1e300
        file[f"{NAME}/judged_bound"][:] = -math.inf
    for words in ((), ("--evidence",), ("--format", "json")):
        assert met("show", str(copy), *words).status == 0
