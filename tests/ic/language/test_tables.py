"""The tables of docs/deck.md are those of the declarations."""

from __future__ import annotations

import re

from ic.language import BLOCKS
from ic.printing.language import PAGE, with_tables


def test_the_tables_of_the_page_are_up_to_date() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert with_tables(text) == text, "run `python -m ic.printing.language`"


def test_each_large_block_has_its_table() -> None:
    marked = re.findall(r"<!-- table of (\w+) -->\n\|", PAGE.read_text(encoding="utf-8"))
    assert sorted(marked) == sorted(
        ["joint", "link", "payload", "run", "scale", "search", "servo", "substitute", "sweep", "tune"]
    )
    assert set(marked) <= set(BLOCKS)
