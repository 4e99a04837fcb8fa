"""Writes the tables of docs/deck.md from the declarations of the language's blocks.

.venv/bin/python scripts/deck_tables.py      writes them anew, after a change of the language
"""

from __future__ import annotations

import re
from pathlib import Path

from reference import table_in_markdown

from ic.language import BLOCKS, BlockDeclaration
from ic.printing.page import Table
from ic.text.complaints import with_article

PAGE = Path(__file__).parents[1] / "docs" / "deck.md"
MARK = "<!-- table of {} -->"
"""The comment above a generated table of docs/deck.md, with the block's name."""


def table(block: BlockDeclaration) -> list[str]:
    """The block's entries as a table in Markdown."""
    by_key = block.within and not block.named and not block.statements
    rows = [(entry.name if by_key else entry.written, entry.doc, entry.default) for entry in block.entries]
    head = (f"{'key' if by_key else 'entry'} of {with_article(block.name)}", "is", "default")
    free = [f"| others | {block.free} | |"] if block.free else []
    return [*table_in_markdown(Table(head=head, rows=rows)), *free]


def with_tables(text: str) -> str:
    """The page with each table that has such a mark generated anew. Raises KeyError where a mark names no block."""

    def with_table(match: re.Match[str]) -> str:
        return f"{match[1]}\n" + "".join(f"{line}\n" for line in table(BLOCKS[match[2]]))

    mark = re.escape(MARK).replace(r"\{\}", r"(\w+)")
    return re.sub(rf"({mark})\n(?:\|.*\n)*", with_table, text)


def main() -> None:
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
