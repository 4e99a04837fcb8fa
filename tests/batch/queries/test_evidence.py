"""What cases show of requirements over cases: verdicts, exit codes, JSON, the table of a report."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.queries.evidence import NOTHING_DRAWN, SOME_OF_THE_TABLE, evidence, percent_above, percent_below
from batch.report.contents.gathering import gather
from batch.report.html.page import page
from met.cli import main
from met.statistics.confidence import lower_bound, percentile_rank, upper_bound

DECK = """
#include <two_link.ic>
run spread like nominal {
    rates { dynamics = 200 Hz; servos = 100 Hz; record = 20 Hz; }
    record = [];
    remove settle;
    metric late = settling_time { of = shoulder.qd; target = slow; band = 2 %; }
    metric past = overshoot { of = shoulder.qd; target = slow; }
    REQUIRED
}
sweep built of spread {
    vary gearbox.ki = [0.1, 0.125] V/rad;
    sample random(CASES) { gearbox.kp = uniform(0.015, 0.025) V*s/rad; }
}
sweep grid of spread { vary gearbox.kp = linspace(0.015, 0.025, 11) V*s/rad; }
"""


def ran(folder: Path, required: str, *command: str, cases: int = 100, sweep: str = "built") -> tuple[int, Path]:
    """The exit code of `met run` and the archive."""
    (folder / "spread.ic").write_text(DECK.replace("REQUIRED", required).replace("CASES", str(cases)), encoding="utf-8")
    out = folder / "a.h5"
    return main(["run", str(folder / "spread.ic"), sweep, "-o", str(out), "--no-picture", *command]), out


@pytest.mark.slow
def test_each_design_point_has_its_verdict_from_its_own_cases(tmp_path: Path) -> None:
    texts = ["late < 2.4 s in 95 % of cases with 90 % confidence", "percentile(late, 5 %) > 2 s with 90 % confidence"]
    ran(tmp_path, " ".join(f"require {text};" for text in texts))
    archive = batch.open(tmp_path / "a.h5")
    late, ki = archive["late"].values, archive["gearbox.ki"].values
    with ArchiveFile(tmp_path / "a.h5") as file:
        rows = evidence(file.groups[0])
    assert [row.chosen for row in rows] == 2 * [{"gearbox.ki": "0.1 V/rad"}, {"gearbox.ki": "0.125 V/rad"}]
    for row, text in zip(rows, np.repeat(texts, 2), strict=True):
        here = late[ki == float(row.chosen["gearbox.ki"].split()[0])]
        missed = int((here >= 2.4).sum()) if "95" in text else int((here <= 2.0).sum())
        assert (row.requirement.text, row.cases, row.missed) == (text, 100, missed)
        assert row.lower == lower_bound(100, missed, 0.9) and row.upper == upper_bound(100, missed, 0.9)
        wanted = "demonstrated" if row.lower >= 0.95 else "refuted" if row.upper < 0.95 else "not shown"
        assert row.verdict == wanted
        rank = percentile_rank(100, 0.95, 0.9)
        bound = np.sort(here)[rank - 1] if "95" in text else np.sort(here)[100 - rank]
        assert row.bound == bound and row.value in (here.max(), here.min())
    assert len({row.verdict for row in rows}) > 1, "the limits tell the design points apart"


@pytest.mark.release
@pytest.mark.parametrize(("required", "cases", "code", "said"), [
    ("require late < 5 s in 95 % of cases with 90 % confidence;", 45, 0, "demonstrated  45 of 45 cases meet it: at "
     "least 95.01 % of all do"),
    ("require late < 5 s in 95 % of cases with 90 % confidence;", 44, 1, "not shown  44 of 44 cases meet it: at least "
     "94.90 % of all do"),
    ("require late < 0.1 s in 95 % of cases with 90 % confidence;", 45, 1, "refuted  0 of 45 cases meet it: at most"),
    ("require late < 5 s in 95 % of cases;", 3, 0, "met  3 of 3 cases meet it"),
    ("require late < 0.1 s in 95 % of cases;", 3, 1, "missed  0 of 3 cases meet it"),
    ("require calm: always(abs(*.qd - *.servo.command) < 1 deg/s, after = 4 s) in 95 % of cases with 90 % confidence;",
     45, 0, "demonstrated  45 of 45 cases meet it: at least 95.01 % of all do; in 95 % of all it is at least 0.9"),
    ("require always(abs(*.qd - *.servo.command) < 1 deg/s) in 95 % of cases with 90 % confidence;", 45, 1,
     "refuted  0 of 45 cases meet it: at most"),
])  # fmt: skip
def test_verdicts_decide_the_exit_code_and_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], required: str, cases: int, code: int, said: str
) -> None:
    assert ran(tmp_path, required, cases=cases)[0] == code
    shown = capsys.readouterr().out
    assert shown.count(said) == 2, shown
    with ArchiveFile(tmp_path / "a.h5") as file:
        report = gather(file)
    [[demand]] = [verdict.demands for verdict in report.verdicts]
    assert demand.verdict == said.split("  ")[0]
    what = "demonstrated" if "confidence" in required else "met"
    assert f"Requirements {what if code == 0 else f'not {what}'}</p>" in page(report)
    if "not shown" in said:
        assert "1 more case would show it if it does not miss it" in shown
    assert main(["show", str(tmp_path / "a.h5")]) == 0
    assert capsys.readouterr().out.count(said) == 2


@pytest.mark.slow
def test_without_draws_each_case_is_judged_by_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    required = "require late < 5 s in 95 % of cases with 90 % confidence;"
    assert ran(tmp_path, required, sweep="grid")[0] == 0
    assert f"met  11 of 11 cases meet it; {NOTHING_DRAWN}" in capsys.readouterr().out
    assert ran(tmp_path, required.replace("5 s", "2.3 s"), sweep="grid")[0] == 1


@pytest.mark.slow
def test_some_cases_of_a_table_give_no_confidence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    required = "require late < 5 s in 95 % of cases with 90 % confidence;"
    ran(tmp_path, required, "--case", "#3", "--case", "#4")
    assert f"met  2 of 2 cases meet it; {SOME_OF_THE_TABLE}" in capsys.readouterr().out


@pytest.mark.slow
def test_programs_and_reports_have_the_rows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "late < 5 s in 95 % of cases with 90 % confidence"
    ran(tmp_path, f"require {text};", cases=50)
    capsys.readouterr()
    assert main(["show", str(tmp_path / "a.h5"), "--format", "json"]) == 0
    [required] = json.loads(capsys.readouterr().out)["experiments"][0]["requirements"]
    assert [(row["chosen"], row["verdict"]) for row in required["evidence"]] == [
        ({"gearbox.ki": "0.1 V/rad"}, "demonstrated"), ({"gearbox.ki": "0.125 V/rad"}, "demonstrated")
    ]  # fmt: skip
    assert main(["report", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.html")]) == 0
    written = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "Requirements demonstrated" in written and "at least 95.49 %" in written


@pytest.mark.slow
@pytest.mark.parametrize("forged", [[2.0], [-0.1], [0.9, 0.9], ["0.9"]])
def test_a_forged_share_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], forged: list[object]) -> None:
    _, path = ran(tmp_path, "require late < 5 s in 95 % of cases;", cases=3)
    with h5py.File(path, "r+") as file:
        file["requirement"].attrs["share"] = forged
    capsys.readouterr()
    assert main(["show", str(path)]) == 2
    assert "error[E302]" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "forged"), [("share", 1.0), ("share", 1.0 - 1e-12), ("share", 1e-12), ("confidence", 1.0)]
)
def test_a_forged_share_that_nothing_shows_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, forged: float
) -> None:
    _, path = ran(tmp_path, "require late < 5 s in 95 % of cases with 90 % confidence;", cases=3)
    with h5py.File(path, "r+") as file:
        file["requirement"].attrs[name] = [forged]
    capsys.readouterr()
    assert main(["show", str(path)]) == 2
    assert "a requirement asks for what no number of cases shows" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("forged", [0, -3, "many", 2.5])
def test_a_forged_number_of_cases_at_most_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], forged: object
) -> None:
    _, path = ran(tmp_path, "require late < 5 s in 95 % of cases with 90 % confidence;", cases=3)
    with h5py.File(path, "r+") as file:
        file.attrs["until_shown"] = forged
    capsys.readouterr()
    assert main(["show", str(path)]) == 2
    assert "attribute `until_shown` is no number of cases" in capsys.readouterr().err


def test_shares_are_rounded_to_the_safe_side() -> None:
    assert percent_below(0.99699) == "99.69 %" and percent_above(0.99691) == "99.70 %"
    assert (
        percent_below(0.9999699) == "99.9969 %" and percent_below(0.0) == "0.00 %" and percent_above(1.0) == "100.00 %"
    )


@pytest.mark.slow
def test_a_share_of_cases_is_not_missed_by_a_rounding(tmp_path: Path) -> None:
    share = float(np.nextafter(np.nextafter(7 / 11, 1.0), 1.0))
    assert share * 11 > 7
    _, path = ran(tmp_path, "require late < 5 s in 7 % of cases;", sweep="grid")
    for met, verdict in ((7, "met"), (6, "missed")):
        with h5py.File(path, "r+") as file:
            file["met"][...] = [[1]] * met + [[0]] * (11 - met)
            file["requirement"].attrs["share"] = [share]
        with ArchiveFile(path) as archive:
            assert [(row.missed, row.verdict) for row in evidence(archive.groups[0])] == [(11 - met, verdict)]
