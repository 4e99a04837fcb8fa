"""A page of `met doc` as data, made once from declarations, and its writers: for a terminal, and for programs."""

from __future__ import annotations

import re
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from ic.printing.columns import columns
from met.frozen import frozen

NARROWEST = 40
"""Smallest width of a column of text; a narrower one is written below its row."""


_SHORT_CODE = re.compile(r"`[^`]{1,40}`")
_BLANK = "\0"
"""Stands for a blank at which no line is broken."""


def terminal_width() -> int | None:
    """The columns of the terminal of standard output; None where it is not a terminal."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def described(rows: Sequence[Sequence[str]], *, width: int | None, head: bool = False, indent: str = "  ") -> list[str]:
    """A table as `columns` makes it, whose last cells are text. Where it is wider than `width`, the text is wrapped in
    its column, or, in a terminal too narrow for that, below the other cells of its row.

    head  True where the first row names the columns
    """
    lines = columns(rows, indent=indent)
    if width is None or max(map(len, lines), default=0) <= width:
        return lines
    count = max(map(len, rows))
    whole = [row if len(row) == count else (*row, *("",) * (count - len(row))) for row in rows]
    heads = columns([(*row[:-1], "|") for row in whole], indent=indent)
    start = max(map(len, heads)) - 1
    if width - start >= NARROWEST:
        return [line for cells, row in zip(heads, whole, strict=True) for line in _beside(cells[:-1], row[-1], width)]
    below = f"{indent}    "
    lines = []
    for number, (cells, row) in enumerate(zip(heads, whole, strict=True)):
        lines += [cells[:-1].rstrip(), *([] if head and number == 0 else _filled(row[-1], width, below))]
    return lines


def paragraphs(text: str, *, width: int | None) -> Iterator[str]:
    """The lines of a docstring, its paragraphs filled to `width`; lines set in by four blanks stay as they are."""
    lines = text.splitlines()
    if width is None or max(map(len, lines), default=0) <= width:
        yield from lines
        return
    paragraph: list[str] = []
    for line in lines:
        if line.strip() and not line.startswith("    "):
            paragraph.append(line.strip())
            continue
        yield from _filled(" ".join(paragraph), width, "")
        paragraph = []
        yield line
    yield from _filled(" ".join(paragraph), width, "")


def fitted(lines: Iterable[str], *, width: int | None) -> Iterator[str]:
    """Lines of text, each filled to `width`; lines that are set in by four blanks stay as they are."""
    for line in lines:
        if width is None or len(line) <= width or line.startswith("    "):
            yield line
        else:
            blanks = line[: len(line) - len(line.lstrip())]
            yield from _filled(line.strip(), width, blanks)


def _beside(cells: str, text: str, width: int) -> list[str]:
    first, *more = _filled(text, width, " " * len(cells)) or [""]
    return [(cells + first[len(cells) :]).rstrip(), *more]


def _filled(text: str, width: int, indent: str) -> list[str]:
    """Lines of a text; code between backticks stays in one line where it is short."""
    whole = _SHORT_CODE.sub(lambda code: code[0].replace(" ", _BLANK), text)
    lines = textwrap.wrap(
        whole,
        width,
        initial_indent=indent,
        subsequent_indent=indent,
        break_on_hyphens=False,
        break_long_words=False,
    )
    return [line.replace(_BLANK, " ") for line in lines]


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
    """The lines of a page's text or table."""
    if isinstance(part, str):
        return part.splitlines()
    rows = [part.head, *part.rows] if part.headed else part.rows
    lines = [*filter(None, [part.caption]), *described(rows, width=width, head=part.headed)]
    below = [*part.notes, *map(": ".join, part.words)]
    return [*lines, *(f"  {line}" for line in below)] if part.rows else []


def in_json(pages: Sequence[Page]) -> object:
    """The records of pages, for programs: those of the only one, or of all in one list."""
    return pages[0].records if len(pages) == 1 else [record for page in pages for record in page.records]
