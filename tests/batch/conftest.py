"""An engine that answers at once, in place of the real one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from batch.report.contents import gathering
from met import run
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


@pytest.fixture(autouse=True)
def answers_are_not_run_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports have no module of an engine that only answers."""
    gather = gathering.gather

    def gathered(*args: Any, simulate: bool = False, **options: Any) -> Any:
        return gather(*args, simulate=simulate and run.prepare is not plans.Answering, **options)

    monkeypatch.setattr(gathering, "gather", gathered)
