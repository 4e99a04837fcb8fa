"""`met bed` as someone types it, in a folder with the deck of the test's file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from met import cli
from tests.hw.conftest import on_pty

__all__ = ["on_pty"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Path:
    """The folder; a file's `DECK` is deck.ic."""
    monkeypatch.chdir(tmp_path)
    if hasattr(request.module, "DECK"):
        (tmp_path / "deck.ic").write_text(request.module.DECK, encoding="utf-8")
    return tmp_path


@pytest.fixture
def met_bed(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """`met bed ...`: exit status, what was said, and what was complained of."""

    def run(*words: str) -> tuple[int, str, str]:
        status = cli.main(["bed", *words])
        told = capsys.readouterr()
        return status, told.out, told.err

    return run
