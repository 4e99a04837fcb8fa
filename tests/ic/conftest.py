"""A place to write decks in."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.decktext import Desk


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Desk:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MET_DECK_PATH", raising=False)
    return Desk(tmp_path)
