"""docs/sensitivity.md: its deck is run, and what is printed is what the page shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.docs.mended_servo import met

PAGE = (Path(__file__).parents[2] / "docs" / "sensitivity.md").read_text()


@pytest.mark.slow
def test_the_page_shows_what_is_printed(tmp_path: Path) -> None:
    deck = re.search(r"<!-- parts\.ic -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    shown = re.search(r"\$ met sensitivity parts\.h5 settle\n(.*?)```", PAGE, re.DOTALL)
    assert deck is not None and shown is not None
    (tmp_path / "parts.ic").write_text(deck[1])
    met(tmp_path, "run", "parts.ic", "parts", "--histories", "none", "-q", "--no-picture", "-o", "parts.h5", status=0)
    assert met(tmp_path, "sensitivity", "parts.h5", "settle", status=0) == shown[1]
