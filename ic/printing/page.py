"""A page of `met doc` as data, made once from declarations, and its writers: for a terminal, as Markdown, for JSON."""

from __future__ import annotations

import re
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
    prose = paragraphs(_dedented(page.prose), width=None if width is None else width - 2)
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


def in_markdown(page: Page, level: int) -> Iterator[str]:
    """The lines of a page in Markdown, under a heading of this level."""
    code, comma, place = page.usage.partition(", in a")
    summary = f"{page.summary[:1].upper()}{page.summary[1:].removesuffix('.')}." if page.summary else ""
    prose = _dedented(page.prose).splitlines()
    return separated(
        [
            [f"{'#' * level} {page.title}"],
            [_escaped(summary)],
            [line if line.startswith("    ") else _escaped(line) for line in prose],
            [f"In a deck: `{code}`{comma}{place}" if code else ""],
            *([_escaped(fact)] for fact in page.facts),
            *(section for part in page.parts for section in _part_in_markdown(part)),
        ]
    )


def _part_in_markdown(part: str | Table) -> list[list[str]]:
    if isinstance(part, str):
        return [[_escaped(part)]]
    words = [f"`{word}`: {_escaped(meaning)}" for word, meaning in part.words]
    sections = [
        [f"{_escaped(part.caption)}:" if part.caption else ""],
        table_in_markdown(part),
        *([_escaped(note)] for note in part.notes),
        [f"{'. '.join(words)}." if words else ""],
    ]
    return sections if part.rows else []


def table_in_markdown(table: Table) -> list[str]:
    """The head and the rows of a table in Markdown."""
    rows = [(f"`{first}`", *(_escaped(cell).replace("|", "\\|") for cell in cells)) for first, *cells in table.rows]
    head, *lines = (f"| {' | '.join(row)} |" for row in (table.head, *rows))
    return [head, f"|{'---|' * len(table.head)}", *lines]


def in_json(pages: Sequence[Page]) -> object:
    """The records of pages, for programs: those of the only one, or of all in one list."""
    return pages[0].records if len(pages) == 1 else [record for page in pages for record in page.records]


def _dedented(doc: str) -> str:
    return textwrap.dedent(doc).strip()


def _escaped(text: str) -> str:
    """Text without accidental Markdown marks, except code between backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(part if part.startswith("`") else re.sub(r"([*<\[\]])", r"\\\1", part) for part in parts)
