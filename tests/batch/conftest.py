"""An engine that answers at once, in place of the real one."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.batch import plans


@pytest.fixture
def engine(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Cases answered by closed formulas (tests/batch/plans.py)."""
    plans.answering(monkeypatch)
    yield


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A fresh folder, and being in it."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
