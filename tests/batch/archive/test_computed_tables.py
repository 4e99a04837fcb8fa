"""An archive of very many cases holds what its table is computed from, and gives the same plan and cases back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.campaigns.replaying import differences
from met.plan import file as plan_file
from met.plan.columns import ComputedColumn

DECK = """
#include <two_link.ic>
run short like nominal { duration = 1 s; }
sweep them of short {
    vary links.upper.mass = linspace(40, 60, 150) kg;
    sample random(120) { gearbox.ki = uniform(0.1, 0.2) V/rad; }
    exclude when links.upper.mass > 55 kg and gearbox.ki > 0.15 V/rad;
}
"""


@pytest.fixture
def archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "deck.ic").write_text(DECK, encoding="utf-8")
    monkeypatch.setattr(plan_file, "TABLE_ROWS", 10_000)
    plan = ic.compile(tmp_path / "deck.ic", select=["them"])
    return batch.run(plan, output=tmp_path / "a.h5", cases=[0, 7, 12_345], histories="all").path


@pytest.mark.slow
def test_the_plan_of_an_archive_computes_the_table_that_was_run(archive: Path) -> None:
    plan = ic.compile(archive.parent / "deck.ic", select=["them"])
    with ArchiveFile(archive) as file:
        back = file.plan()
    for mine, theirs in zip(plan.experiments[0].cases.coordinates, back.experiments[0].cases.coordinates, strict=True):
        assert isinstance(theirs.values, ComputedColumn)
        assert np.asarray(mine.values).tobytes() == np.asarray(theirs.values).tobytes()


@pytest.mark.slow
def test_a_case_of_it_can_be_run_again(archive: Path) -> None:
    with ArchiveFile(archive) as file:
        plan = file.plan()
    again = batch.run(plan, output=archive.with_name("b.h5"), cases=[12_345], histories="all").path
    assert differences(archive, again) == []
