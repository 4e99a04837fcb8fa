"""The page docs/reference.md: all that models declare, and the subjects of `met doc`, as Markdown."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

from ic.language import BLOCKS
from ic.meaning.mechanics import dh, shapes
from ic.printing import subjects, sweeps
from ic.printing.language import type_of
from ic.printing.models import (
    KINDS,
    WHERE_WRITTEN,
    declared_facts,
    default,
    recorded_channels,
    rows,
    sources,
    unit_in_words,
    where_written,
    words_in,
)
from met import models

HEAD = """\
# Models, their parameters, channels, units

This page lists everything that a deck can contain: the blocks of the deck language, the models with their parameters
and channels, and the units, functions and distributions. [Writing decks](deck.md) explains how to use them, and
[models](models.md) how to add a model. `met doc` prints the same in a terminal, also for models of other packages.
`met doc --markdown` writes this page from the declarations in the code, and a test keeps it up to date.

Defaults and ranges are in SI units. A parameter whose default is `needed` must be written. The unit `-` means a pure
number.
"""


def page() -> Iterator[str]:
    """The lines of the page, about MET's own models."""
    yield from HEAD.splitlines()
    yield ""
    yield f"- [Blocks of a deck](#blocks-of-a-deck): {', '.join(f'[{name}](#block-{name})' for name in BLOCKS)}"
    for kind in KINDS:
        names = ", ".join(f"[{name}](#{kind}-{name})" for name in models.find_own(kind))
        yield f"- [{_title(kind)}](#{kind}s): {names}"
    for name in TITLES:
        yield f"- [{TITLES[name]}](#{_anchor(TITLES[name])})"
    yield from _blocks()
    for kind in KINDS:
        yield ""
        yield f"## {_title(kind)}"
        yield ""
        yield f"In a deck: {_code(WHERE_WRITTEN[kind])}"
        for model in models.find_own(kind).values():
            yield ""
            yield from _model(kind, model)
    yield from _shapes()
    yield from _dh()
    yield from _channels()
    yield from _units()
    for name in sweeps.SUBJECTS:
        yield from _words(name)


def _blocks() -> Iterator[str]:
    yield ""
    yield "## Blocks of a deck"
    for block in BLOCKS.values():
        yield ""
        yield f"### block {block.name}"
        yield ""
        yield f"{_escaped(block.doc)}"
        yield ""
        yield f"In a deck: `{block.written}`"
        yield ""
        rows = [(each.written, type_of(each) or "-", each.default, each.doc) for each in block.entries]
        yield from _table([("written", "type", "default", "meaning"), *rows], whole=True)
        if block.free:
            yield ""
            yield f"Also {_escaped(block.free)}."


TITLES = {
    "shapes": "Shapes of links", "dh": "Denavit-Hartenberg numbers", "channels": "Channels", "units": "Units",
    "functions": "Functions", "designs": "Designs of samples", "distributions": "Distributions",
}  # fmt: skip


def _title(kind: models.Kind) -> str:
    return f"{kind.capitalize()}s"


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _model(kind: models.Kind, model: Any) -> Iterator[str]:
    yield f"### {kind} {model.name}"
    yield ""
    yield from _prose(model.doc)
    yield ""
    yield f"In a deck: {_code(where_written(kind, model))}"
    yield from (f"\n{_escaped(fact)}" for fact in declared_facts(kind, model))
    parameters = models.written(model)
    if parameters:
        yield ""
        yield from _table(rows(parameters))
    for source in sources(parameters):
        yield ""
        yield _escaped(source)
    words = [f"`{word}`: {_escaped(text)}" for word, text in words_in(kind, parameters)]
    if words:
        yield ""
        yield ". ".join(words) + "."
    for text, parts in recorded_channels(kind, model):
        yield ""
        yield f"{_escaped(text)}:"
        yield ""
        yield from _table([("name", "unit", "meaning"), *parts])


def _shapes() -> Iterator[str]:
    yield ""
    yield f"## {TITLES['shapes']}"
    yield ""
    yield from _prose(subjects.BEGIN)
    for name, shape in shapes.SHAPES.items():
        yield ""
        yield f"### shape {name}"
        yield ""
        yield from _table(rows(shape.parameters))


def _dh() -> Iterator[str]:
    yield ""
    yield f"## {TITLES['dh']}"
    yield ""
    yield from _prose(dh.__doc__ or "")
    yield ""
    yield from _table(
        [
            ("name", "unit", "default", "meaning"),
            *((each.name, each.unit, default(each), each.doc) for each in dh.NUMBERS),
        ]
    )


def _channels() -> Iterator[str]:
    yield ""
    yield f"## {TITLES['channels']}"
    yield ""
    yield f"The signals that a run can record and a metric can evaluate. {subjects.SHORT_FORMS}"
    yield ""
    found = subjects.channels()
    rows = [
        (each["path"], unit_in_words(each["unit"]), each["components"], each["meaning"], each["frame"])
        for each in found
    ]
    yield from _table([("channel", "unit", "components", "meaning", "axes"), *rows])
    yield ""
    yield from _table([("channel", "is"), *subjects.OF_ANY])
    yield ""
    yield ". ".join(f"`{word}`: {text}" for word, text in subjects.words_of(found)) + "."


def _units() -> Iterator[str]:
    yield ""
    yield f"## {TITLES['units']}"
    yield ""
    rows = [(each["name"], each["word"], subjects.in_si(each)) for each in subjects.unit_table()]
    yield from _table([("unit", "word", "is"), *rows])


def _words(name: str) -> Iterator[str]:
    subject = sweeps.SUBJECTS[name]
    yield ""
    yield f"## {TITLES[name]}"
    yield ""
    yield f"{_escaped(subject.what)}."
    yield ""
    yield f"In a deck: `{subject.example}`"
    yield ""
    yield from _table([("written", "is"), *((f"{written}", text) for _, written, text in subject.rows())], whole=True)
    yield ""
    yield _escaped(subject.more)


def _table(rows: Sequence[Sequence[str]], *, whole: bool = False) -> Iterator[str]:
    """A table whose first row is its head and whose first column names things, several behind commas; or one, whole."""
    head, *others = rows
    yield f"| {' | '.join(head)} |"
    yield f"|{'---|' * len(head)}"
    for row in others:
        first = f"`{row[0]}`" if whole else " ".join(f"`{name}`" for name in row[0].split(", "))
        yield f"| {' | '.join([first, *map(_cell, row[1:])])} |"


def _cell(text: str) -> str:
    return _escaped(text).replace("|", "\\|")


def _code(text: str) -> str:
    """The text of `where_written` with its deck code marked as code."""
    code, where, words = text.partition(", in a ")
    return f"`{code}`{where}{words}"


def _prose(doc: str) -> Iterator[str]:
    """A docstring as Markdown: lines indented by four blanks are kept, all else is text."""
    for line in textwrap.dedent(doc).strip().splitlines():
        yield line if line.startswith("    ") else _escaped(line)


def _escaped(text: str) -> str:
    """Text without accidental Markdown marks, except code between backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(part if part.startswith("`") else re.sub(r"([*<\[\]])", r"\\\1", part) for part in parts)
