"""A campaign of short tasks, and what it gives undisturbed."""

from __future__ import annotations

from pathlib import Path

import pytest

import batch
from tests.batch.begun import plan, short_tasks


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The archive of a serial run that nothing happened to."""
    return batch.run(plan(), output=tmp_path_factory.mktemp("undisturbed") / "a.h5", threads=1).path.read_bytes()


@pytest.fixture(autouse=True)
def sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    short_tasks(monkeypatch)


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Where a campaign goes, in a folder with nothing else."""
    (tmp_path / "out").mkdir()
    return tmp_path / "out" / "a.h5"
