"""docs/report.md says what the code says, and its pictures are those that the code makes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from batch.queries import grids
from batch.report.contents import histories, overview, simulation, stability
from batch.report.contents.gathering import MOST_LINES
from tests.batch.report import figures
from tests.batch.report.browser import PACKAGE, program

PAGE = (figures.FOLDER.parent / "report.md").read_text(encoding="utf-8")


def test_the_limits_are_those_of_the_code() -> None:
    for said in (
        f"{overview.MOST_POINTS:,} cases",
        f"the {overview.KEPT} worst",
        f"{histories.MOST_POINTS:,} points",
        f"{histories.WHERE_RUN_AGAIN:,} numbers",
        f"{histories.MOST_VALUES:,} if cases are not run again",
        f"of {simulation.MOST_STRUCTURES} structures",
        f"{simulation.MOST_EXACT:,} bytes",
        f"{grids.MOST_LEVELS} × {grids.MOST_LEVELS} cells",
        f"{stability.MOST_CASES} cases, of six",
        f"{MOST_LINES:,} lines",
    ):
        assert said in PAGE
    assert stability.MOST_LOOPS == 6


def test_pictures_of_reports_are_there_and_made_by_one_command() -> None:
    pages = PAGE + (figures.FOLDER.parent / "best.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"figures/(report_\w+\.png)", pages))
    assert shown == set(re.findall(r"report_\w+\.png", figures.__doc__ or ""))
    assert shown == {path.name for path in figures.FOLDER.glob("report_*.png")}
    assert "python -m tests.batch.report.figures" in PAGE


@pytest.mark.browser
def test_the_command_makes_them(tmp_path: Path) -> None:
    if program() is None:
        pytest.skip(f"no chromium; on Debian or Ubuntu: apt-get install {PACKAGE}")
    written = figures.draw(tmp_path)
    assert all(path.stat().st_size > 20_000 for path in written)
    assert {path.name for path in written} == {path.name for path in figures.FOLDER.glob("report_*.png")}
