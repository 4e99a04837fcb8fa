"""A page of `met doc` as data, made once from declarations, and its writers: for a terminal, and for programs."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from ic.printing.wrapping import described, paragraphs
from met.frozen import frozen


@frozen(kw_only=True)
class Table:
    """A table of a page; left out where it has no rows. Its first column is code of a deck, its last one is text.

    head   the names of the columns;  headed: whether a terminal shows them
    notes  lines below the table;  words: the words in its units that depend on the use, with their meanings
    """

    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    headed: bool = True
    caption: str = ""
    notes: Sequence[str] = ()
    words: Sequence[tuple[str, str]] = ()


@frozen(kw_only=True)
class Page:
    """A page of `met doc`.

    subject  the word that `met doc` knows it by;  title: its heading in Markdown
    summary  what it is, in a sentence;  prose: a docstring that says more
    usage    how a deck writes it, then where: `bed = MODEL(...), in a run`;  facts: further lines
    parts    paragraphs and tables, in order
    records  what programs get: a list, or the one object of the language; nothing of a page that is only text
    """

    subject: str = ""
    title: str = ""
    summary: str = ""
    prose: str = ""
    usage: str = ""
    facts: Sequence[str] = ()
    parts: Sequence[str | Table] = ()
    records: Any = ()


def separated(sections: Iterable[Iterable[str]]) -> Iterator[str]:
    """The lines of all sections that have a text, with an empty line between two sections."""
    for position, lines in enumerate(filter(any, map(list, sections))):
        yield from ["", *lines] if position else lines


def in_terminal(page: Page, width: int | None) -> Iterator[str]:
    """The lines of a page for a terminal of this width; None: every row of a table is one line."""
    head = f"{page.subject}: {page.summary}" if page.summary else page.title
    prose = paragraphs(textwrap.dedent(page.prose).strip(), width=None if width is None else width - 2)
    usage = f"In a deck: {page.usage}" if page.usage else ""
    return separated(
        [
            [head, *(f"  {line}".rstrip() for line in prose)],
            [usage, *page.facts],
            *(_part_in_terminal(part, width) for part in page.parts),
        ]
    )


def _part_in_terminal(part: str | Table, width: int | None) -> list[str]:
    if isinstance(part, str):
        return part.splitlines()
    rows = [part.head, *part.rows] if part.headed else part.rows
    lines = [*filter(None, [part.caption]), *described(rows, width=width, head=part.headed)]
    below = [*part.notes, *map(": ".join, part.words)]
    return [*lines, *(f"  {line}" for line in below)] if part.rows else []


def in_json(pages: Sequence[Page]) -> object:
    """The records of pages, for programs: those of the only one, or of all in one list."""
    return pages[0].records if len(pages) == 1 else [record for page in pages for record in page.records]
