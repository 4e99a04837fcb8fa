"""Warnings that a run allows: in the archive, with their reasons, in `met show` and in a report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.report import report
from batch.terminal.show import show
from met.plan import Allowance
from tests.batch import plans

ALLOWED = (Allowance("D105", "the paper's own rates"), Allowance("D102", "no end is needed"))


@pytest.fixture
def archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    plans.answering(monkeypatch)
    batch.run(plans.plan(replace(plans.nominal(), allowances=ALLOWED)), output=tmp_path / "a.h5")
    return tmp_path / "a.h5"


@pytest.mark.slow
def test_they_are_archived_and_shown(archive: Path) -> None:
    with ArchiveFile(archive) as file:
        assert file.groups[0].attributes["allowed"] == (
            "D105, because the paper's own rates\nD102, because no end is needed"
        )
        lines = show(file, width=100).splitlines()
    assert "  allowed: D105, because the paper's own rates" in lines
    assert "  allowed: D102, because no end is needed" in lines


@pytest.mark.slow
def test_a_report_has_them(archive: Path) -> None:
    report(archive, archive.with_suffix(".html"))
    page = archive.with_suffix(".html").read_text(encoding="utf-8")
    assert "D105, because the paper" in page and "D102, because no end is needed" in page


@pytest.mark.slow
def test_an_archive_of_a_run_that_allows_none_has_no_such_attribute(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans.answering(monkeypatch)
    batch.run(plans.plan(plans.nominal()), output=tmp_path / "b.h5")
    with ArchiveFile(tmp_path / "b.h5") as file:
        assert "allowed" not in file.groups[0].attributes and file.groups[0].allowed == ()
