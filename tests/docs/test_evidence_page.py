"""docs/evidence.md: its decks are run, and what is printed is what the page shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.docs.mended_servo import met

PAGE = (Path(__file__).parents[2] / "docs" / "evidence.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_table_is_the_one_that_is_printed(tmp_path: Path) -> None:
    deck = re.search(r"<!-- spread\.ic -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    shown = re.search(r"\$ met show spread\.h5 --evidence\n(.*?)```", PAGE, re.DOTALL)
    [ran] = re.findall(r"^\$ met (run spread\.ic .*)$", PAGE, re.MULTILINE)
    assert deck is not None and shown is not None
    (tmp_path / "spread.ic").write_text(deck[1], encoding="utf-8")
    met(tmp_path, *ran.split(), status=1)
    _, _, printed = met(tmp_path, "show", "spread.h5", "--evidence", status=0).partition("\n")
    assert printed == shown[1].partition("\n")[2], "but for the size of the archive"
