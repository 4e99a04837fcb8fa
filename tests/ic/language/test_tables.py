"""The tables of docs/deck.md are those of the declarations."""

from __future__ import annotations

import re

from deck_tables import PAGE, with_tables

from ic.language import BLOCKS


def test_the_tables_of_the_page_are_up_to_date() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert with_tables(text) == text, "run `.venv/bin/python scripts/deck_tables.py`"


def test_each_large_block_has_its_table() -> None:
    marked = re.findall(r"<!-- table of (\w+) -->\n\|", PAGE.read_text(encoding="utf-8"))
    blocks = ["boom", "joint", "link", "payload", "run", "scale", "search", "servo", "substitute", "sweep", "tune"]
    assert sorted(marked) == blocks
    assert set(marked) <= set(BLOCKS)
