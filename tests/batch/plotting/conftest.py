"""The figures that are drawn, kept for a look at what is in them."""

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """Those of a test, in their order."""
    from batch.plotting import output

    kept: list[Any] = []
    save = output.save
    monkeypatch.setattr(output, "save", lambda figure, path: (kept.append(figure), save(figure, path)))
    yield kept
