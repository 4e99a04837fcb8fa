"""Writes docs/reference.md: the pages of `met doc` about MET's own models and the language, as Markdown.

.venv/bin/python scripts/reference.py      writes it anew, after a change of a declaration
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path

from ic.language import BLOCKS
from ic.printing.models import KINDS, WHERE_WRITTEN, model_page
from ic.printing.page import Page, Table, separated
from ic.printing.subjects import BLOCK_PAGES, OTHER_PAGES, substitute_page
from met import models

FILE = Path(__file__).parents[1] / "docs" / "reference.md"

HEAD = """\
# Models, their parameters, channels, units

This page lists everything that a deck can contain: the blocks of the deck language, the models with their parameters
and channels, and the units, functions and distributions. [Writing decks](deck.md) explains how to use them, and
[models](models.md) how to add a model. `met doc` prints the same in a terminal, also for models of other packages.
`scripts/reference.py` writes this page from the declarations in the code, and a test keeps it up to date.

Defaults and ranges are in SI units. A parameter whose default is `needed` must be written. The unit `-` means a pure
number.
"""


def sections() -> list[tuple[Page, list[Page]]]:
    """The sections of the page: what stands at its head, and the pages in it."""
    blocks = [substitute_page(models.find_own) if name == "substitute" else BLOCK_PAGES[name]() for name in BLOCKS]
    kinds = [
        (
            Page(title=f"{kind.capitalize()}s", usage=WHERE_WRITTEN[kind]),
            [model_page(kind, model) for model in models.find_own(kind).values()],
        )
        for kind in KINDS
    ]
    return [
        (Page(title="Blocks of a deck"), blocks),
        *kinds,
        *((make_page(), []) for make_page in OTHER_PAGES.values()),
    ]


def page() -> Iterator[str]:
    """The lines of the page, about MET's own models."""
    yield from HEAD.splitlines()
    yield ""
    whole = sections()
    for section, pages in whole:
        names = ", ".join(_link(subject_page.subject, subject_page) for subject_page in pages)
        yield f"- {_link(section.title, section)}{': ' if names else ''}{names}"
    for section, pages in whole:
        for level, subject_page in ((2, section), *((3, subject_page) for subject_page in pages)):
            yield from ("", *in_markdown(subject_page, level))


def _link(text: str, page: Page) -> str:
    return f"[{text}](#{page.title.lower().replace(' ', '-')})"


def in_markdown(page: Page, level: int) -> Iterator[str]:
    """The lines of a page in Markdown, under a heading of this level."""
    code, comma, place = page.usage.partition(", in a")
    summary = f"{page.summary[:1].upper()}{page.summary[1:].removesuffix('.')}." if page.summary else ""
    prose = textwrap.dedent(page.prose).strip().splitlines()
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


def _escaped(text: str) -> str:
    """Text without accidental Markdown marks, except code between backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(part if part.startswith("`") else re.sub(r"([*<\[\]])", r"\\\1", part) for part in parts)


def main() -> None:
    FILE.write_text("".join(f"{line}\n" for line in page()), encoding="utf-8")
    print(f"wrote {FILE}")


if __name__ == "__main__":
    main()
