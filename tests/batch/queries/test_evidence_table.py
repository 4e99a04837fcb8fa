"""The table of evidence: its numbers, and its rows in the terminal, pages, CSV files, notebooks, comparisons."""

from __future__ import annotations

import csv
import json
import math
import shlex
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.queries.evidence_table import RequirementEvidence, as_data, notes_of, requirement_evidence, texts_of
from batch.terminal.evidence import evidence_table_lines
from met.cli import main
from met.diagnostic import Problem
from met.statistics.confidence import cases_needed, lower_bound, percentile_rank, upper_bound

DECK = """
#include <two_link.ic>
run spread like nominal {
    rates { dynamics = 200 Hz; servos = 100 Hz; record = 20 Hz; }
    record = [];
    remove settle;
    metric late = settling_time { of = shoulder.qd; target = slow; band = 2 %; }
    metric past = overshoot { of = shoulder.qd; target = slow; }
    require soon: late < 2.45 s in 95 % of cases with 90 % confidence;
    require past < 20 %;
    require step_error(late) < 1 %;
}
sweep built of spread {
    vary gearbox.ki = [100, 125] mV/rad;
    sample random(60) { gearbox.kp = uniform(0.015, KP) V*s/rad; }
}
sweep ways of spread {
    vary integrator = [modified_euler, rk4];
    sample random(30) { gearbox.kp = uniform(0.015, 0.025) V*s/rad; }
}
"""
COMMON = ["--histories", "none", "--no-picture", "-q"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Archives of two versions of the deck, a.h5 with some cases verified and b.h5, and ways.h5 of two structures."""
    where = tmp_path_factory.mktemp("evidence")
    for name, kp in (("a", "0.025"), ("b", "0.030")):
        deck = where / f"{name}.ic"
        deck.write_text(DECK.replace("KP", kp), encoding="utf-8")
        verify = "some" if name == "a" else "none"
        main(["run", str(deck), "built", "-o", str(where / f"{name}.h5"), "--verify", verify, *COMMON])
    main(["run", str(where / "a.ic"), "ways", "-o", str(where / "ways.h5"), "--verify", "none", *COMMON])
    return where


def rows_of(path: Path) -> list[RequirementEvidence]:
    with ArchiveFile(path) as file:
        return requirement_evidence(file.groups, path.name)


@pytest.mark.release
def test_a_row_has_the_numbers_of_the_cases_of_its_design_point(folder: Path) -> None:
    data = batch.open(folder / "a.h5")
    rows = [row for row in rows_of(folder / "a.h5") if row.share is not None]
    assert [(row.requirement.split(":")[0], row.at) for row in rows] == [
        ("soon", "gearbox.ki = 100 mV/rad"),
        ("soon", "gearbox.ki = 125 mV/rad"),
    ]
    for row, ki in zip(rows, (0.100, 0.125), strict=True):
        here = np.flatnonzero(np.isclose(data["gearbox.ki"].values, ki))
        late = data["late"].values[here]
        missed = int((late >= 2.45).sum())
        assert (row.cases, row.missed, row.limit, row.share, row.confidence) == (60, missed, 2.45, 0.95, 0.9)
        assert row.share_met == 1.0 - missed / 60
        assert (row.at_least, row.at_most) == (lower_bound(60, missed, 0.9), upper_bound(60, missed, 0.9))
        rank = percentile_rank(60, 0.95, 0.9)
        assert row.percentile_bound == np.sort(late)[rank - 1]
        assert (row.worst, row.worst_case) == (late.max(), here[late.argmax()])
        assert row.margin == 2.45 - late.max()
        assert row.sigmas == pytest.approx((2.45 - late.mean()) / late.std(ddof=1), rel=1e-12)
        more = cases_needed(0.95, 0.9, missed) - 60 if row.verdict == "not shown" else 0
        assert row.more_cases == more
    assert len({row.verdict for row in rows}) == 2, "the design points come out otherwise"


@pytest.mark.slow
def test_what_every_case_is_to_meet_has_one_row_of_all_cases(folder: Path) -> None:
    [row] = [row for row in rows_of(folder / "a.h5") if row.requirement.startswith("past")]
    past = batch.open(folder / "a.h5")["past"].values
    assert (row.at, row.cases, row.missed, row.worst) == ("", 120, int((past >= 0.2).sum()), past.max())
    assert row.verdict == ("met" if (past < 0.2).all() else "missed")
    assert row.at_least is None and row.sigmas is None, "the cases of two design points are no one sample"


def test_what_is_required_of_errors_by_the_step_has_a_row_of_the_verified_cases(folder: Path) -> None:
    verified, unverified = (
        next(row for row in rows_of(folder / name) if row.requirement.startswith("step_error"))
        for name in ("a.h5", "b.h5")
    )
    assert verified.verdict == "met" and verified.cases > 1 and verified.worst is not None
    assert verified.margin == 0.01 - verified.worst and texts_of(verified).limit == "< 1 %"
    late = next(row for row in rows_of(folder / "a.h5") if row.metric == "late" and row.share is not None)
    assert late.step_error is not None and late.step_error > 0.0
    assert (unverified.verdict, unverified.cases, unverified.worst, unverified.again) == ("not known", 0, None, "")
    assert unverified.why == "nothing is verified: `met run --verify some`"


def test_structures_are_told_apart_by_what_was_chosen_for_them(folder: Path) -> None:
    rows = [row for row in rows_of(folder / "ways.h5") if row.share is not None]
    assert [row.at for row in rows] == ["integrator = modified_euler", "integrator = rk4"]
    assert [row.run for row in rows] == ["ways", "ways"] and all(row.cases == 30 for row in rows)


@pytest.mark.slow
def test_the_command_of_a_row_runs_its_worst_case_to_the_same_value(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    row = rows_of(Path("a.h5"))[0]
    met, *words = shlex.split(row.again)
    assert met == "met"
    main([*words, "-o", "again.h5", *COMMON])
    assert batch.open("again.h5")["late"].values.item() == row.worst


@pytest.mark.slow
def test_terminal_csv_notebook_and_programs_have_the_same_rows(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    rows = list(map(as_data, rows_of(Path("a.h5"))))
    assert main(["show", "a.h5", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["experiments"][0]["evidence"] == rows
    assert main(["export", "a.h5", "-o", "a.csv", "--evidence", "-q"]) == 0
    lines = [line for line in Path("a.csv").read_text("utf-8").splitlines() if not line.startswith("#")]
    read = list(csv.DictReader(lines))
    assert [{name: "" if value is None else str(value) for name, value in row.items()} for row in rows] == read
    table = batch.open("a.h5").met.evidence()
    assert list(table.columns) == list(rows[0])
    for row, (_, found) in zip(rows, table.iterrows(), strict=True):
        for name, value in row.items():
            assert found[name] == value or (value is None and math.isnan(found[name])), name


def test_the_deck_s_units_are_those_of_each_row(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    Path("millis.h5").write_bytes(Path("a.h5").read_bytes())
    with h5py.File("millis.h5", "r+") as file:
        file["late"].attrs["deck_unit"], file["late"].attrs["deck_scale"] = "ms", 1e-3
    assert main(["export", "millis.h5", "-o", "deck.csv", "--evidence", "--units", "deck", "-q"]) == 0
    lines = [line for line in Path("deck.csv").read_text("utf-8").splitlines() if not line.startswith("#")]
    row = next(csv.DictReader(lines))
    assert (row["unit"], row["limit"]) == ("ms", "2450.0")


def test_no_requirement_is_a_formula_of_a_spreadsheet(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    Path("forged.h5").write_bytes(Path("a.h5").read_bytes())
    with h5py.File("forged.h5", "r+") as file:
        file["requirement"][0] = "=HYPERLINK(1)"
    assert main(["export", "forged.h5", "-o", "forged.csv", "--evidence", "-q"]) == 0
    assert "built,'=HYPERLINK(1)," in Path("forged.csv").read_text("utf-8")


@pytest.mark.parametrize(("words", "said"), [
    (["-o", "x.mcap", "--evidence"], "error[E376]: x.mcap would hold no requirements: an MCAP file is no table of "
     "evidence\n = help: `-o FILE.csv` writes one"),
    (["-o", "x.csv", "--evidence", "--case", "#0"], "error[E376]: evidence is of requirements over all cases: its "
     "table has no case\n = help: leave out `--evidence`, or `--signals` and `--case`"),
    (["-o", "x.csv", "--evidence", "--signals", "q"], "error[E376]: evidence is of requirements over all cases: its "
     "table has no signal `q`\n = help: leave out `--evidence`, or `--signals` and `--case`"),
    (["-o", "x.csv", "--evidence", "--metrics"],
     "--evidence is a table of its own: leave out --histories or --metrics"),
])  # fmt: skip
def test_what_a_table_of_evidence_cannot_have_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    monkeypatch.chdir(folder)
    assert main(["export", "a.h5", *words]) == 2
    assert said in capsys.readouterr().err and not list(Path().glob("x.*"))


def test_the_table_fits_a_terminal(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert main(["show", "a.h5", "--evidence"]) == 0
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 100
    assert "  1  soon: late < 2.45 s in 95 % of cases with 90 % confidence\n" in said
    assert "  1.2  gearbox.ki = 125 mV/rad\n" in said
    for row in rows_of(Path("a.h5")):
        texts = texts_of(row)
        assert texts.margin in said and texts.of_all in said and row.again in said
    assert main(["show", "a.h5", "--evidence", "--case", "#0"]) == 2
    assert "--evidence is about all cases: of one, or of signals, ask without it" in capsys.readouterr().err


@pytest.mark.slow
def test_evidence_of_some_of_the_cases_is_refused(folder: Path) -> None:
    with pytest.raises(Problem, match="E388: evidence is of all cases, and here are 2 of 120"):
        batch.open(folder / "a.h5").met.sel(case=[1, 2]).met.evidence()


@pytest.mark.slow
def test_a_comparison_says_what_the_cases_show_now(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    before, now = ([row for row in rows_of(Path(name)) if row.share is not None] for name in ("a.h5", "b.h5"))
    main(["diff", "a.h5", "b.h5"])
    said = capsys.readouterr().out
    assert "  requirements over cases:\n    soon: late < 2.45 s in 95 % of cases with 90 % confidence, " in said
    for one, other in zip(before, now, strict=True):
        assert f"in sigmas {texts_of(one).sigmas}, now {texts_of(other).sigmas}\n" in said
    main(["diff", "a.h5", "b.h5", "--format", "json"])
    [found] = json.loads(capsys.readouterr().out)["experiments"]
    assert [each["b"]["at_least"] for each in found["evidence"][:2]] == [row.at_least for row in now]
    main(["diff", "a.h5", "a.h5"])
    assert "requirements over cases" not in capsys.readouterr().out


@pytest.mark.slow
def test_a_page_has_the_rows_with_the_commands_of_their_worst_cases(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert main(["report", "a.h5", "-q"]) == 0
    page = Path("a.html").read_text("utf-8")
    for row in rows_of(Path("a.h5")):
        assert row.again.replace("'", "&#x27;") in page and f"limit {texts_of(row).limit}".replace("<", "&lt;") in page


def test_a_margin_that_the_step_decides_is_said() -> None:
    row = RequirementEvidence(
        run="r", requirement="late < 2 s", at="", metric="late", unit="s", si_unit="s", scale=1.0, comparison="<",
        limit=2.0, verdict="met", cases=3, missed=0, worst=1.99, worst_case=0, margin=0.01, step_error=0.02,
    )  # fmt: skip
    said = ["late < 2 s: the error by the step is as large as the margin; shorter steps may change it"]
    assert notes_of([row]) == said
    assert notes_of([replace(row, step_error=0.009)]) == [] and notes_of([replace(row, step_error=None)]) == []


def test_words_are_signs_where_the_table_is_too_wide() -> None:
    row = RequirementEvidence(
        run="r", requirement="late < 2 s in 99.99 % of cases with 99.5 % confidence", at="", metric="late", unit="s",
        si_unit="s", scale=1.0, comparison="<", limit=2.0, share=0.9999, confidence=0.995, verdict="not shown",
        cases=1_000_000, missed=123_456, share_met=0.876544, at_least=0.8761234, at_most=0.8769, percentile_bound=123.4,
        worst=1.99, worst_case=0, margin=0.01, more_cases=1_234_567,
    )  # fmt: skip
    wide, narrow = (evidence_table_lines([row], width) for width in (120, 100))
    assert any("at least 87.61 %" in line and "99.99 % with 99.5 %" in line for line in wide)
    assert any("\u2265 87.61 %" in line and "99.99 %, 99.5 %" in line for line in narrow)
    assert max(map(len, narrow)) <= 100 < max(map(len, wide))


@pytest.mark.slow
def test_parts_of_a_sum_of_sweeps_are_told_apart(tmp_path: Path) -> None:
    deck = tmp_path / "sum.ic"
    sweeps = (
        "sweep slow_ones of spread { vary gearbox.kp = [0.015, 0.02] V*s/rad; }\n"
        "sweep fast_ones of spread { vary gearbox.ki = [0.1, 0.12] V/rad; }\n"
        "sweep both = slow_ones + fast_ones;\n"
    )
    deck.write_text(DECK.replace("KP", "0.025") + sweeps, encoding="utf-8")
    main(["run", str(deck), "both", "-o", str(tmp_path / "sum.h5"), "--verify", "none", *COMMON])
    rows = rows_of(tmp_path / "sum.h5")
    assert [row.at for row in rows] == ["slow_ones", "fast_ones"] * 3
    lines = evidence_table_lines(rows, 100)
    assert "  1.1  slow_ones" in lines and "  1.2  fast_ones" in lines
