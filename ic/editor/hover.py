"""The text that an editor shows about a word: the meaning of a key, model, unit or name, and resulting values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ic.editor.completion import parameters_of
from ic.editor.index import DeckIndex, ValueInDeck
from ic.editor.names import NamesInTexts
from ic.editor.structure import UNIT, DeckText, TextEntry
from ic.language import BLOCKS, DEFINITIONS, TOP_LEVEL
from ic.printing.models import summary
from ic.text.lexer import NAME, Token
from met import models
from met.diagnostic import Place
from met.messages.message import shown_place
from met.units import UNITS

MOST_VALUES = 4  # values that are shown of one place; if there are more, their number


def about(text: DeckText, token: Token, names: NamesInTexts, index: DeckIndex, file: str) -> list[str]:
    """Paragraphs, in Markdown, about a word of a text; none where nothing is known of it.

    file  the name that places of the deck give the text's file
    """
    entry = names.entry_at(text, token)
    paragraphs = [*_of_key(token, entry, names), *_of_model(token), *_of_unit(text, token)]
    return [*paragraphs, *_of_name(text, token, names, index), *_of_values(index, token, entry, file)]


def _of_key(token: Token, entry: TextEntry | None, names: NamesInTexts) -> Iterator[str]:
    """The paragraph about a word that begins an entry: its declaration in the block, or in the model."""
    if entry is None or entry.head is None or token.offset != entry.head.offset:
        return
    around = entry.within
    block = BLOCKS.get(around.block) if around is not None else None
    for declared in block.entries if block is not None else ():
        if declared.name.split()[0] == token.text:
            unit = f"unit: {declared.unit}; " if declared.unit not in ("", "1") else ""
            default = declared.default if declared.default.startswith("needed") else f"default: {declared.default}"
            yield f"`{declared.written}`\n\n{declared.doc}\n\n{unit}{default}"
            return
    for parameter in parameters_of(around, names) if around is not None else ():
        if parameter.name == token.text:
            unit = f" in {parameter.unit}" if parameter.unit not in ("", "1") else ""
            default = "needed" if parameter.default is None else f"default: {parameter.default}"
            yield f"`{parameter.name}`{unit}: {parameter.doc}; {default}"
            return
    if around is None and token.text in DEFINITIONS:
        yield f"`{BLOCKS[token.text].written}`\n\n{BLOCKS[token.text].doc}"
    for top in TOP_LEVEL.entries if around is None else ():
        if top.name == token.text:
            yield f"`{top.written}`\n\n{top.doc}"


def _of_model(token: Token) -> Iterator[str]:
    for kind in models.GROUPS:
        model = models.available(kind).get(token.text)
        if model is not None:
            yield f"{kind} model `{token.text}`: {summary(model)}"


def _of_unit(text: DeckText, token: Token) -> Iterator[str]:
    unit = UNITS.get(token.text)
    before = text.source.text[: token.offset].rstrip()[-1:]
    if unit is not None and (before.isdigit() or before in "*/.])^"):
        yield f"unit `{token.text}`: {unit.word}, {unit.measure.scale:g} in SI"


def _of_name(text: DeckText, token: Token, names: NamesInTexts, index: DeckIndex) -> Iterator[str]:
    for definition in names.meant_in(text, token)[:2] if token.kind == NAME else ():
        source = definition.token.source
        line = source.text.split("\n")[source.line(definition.token.offset) - 1].strip()
        size = index.units.get(token.text) if definition.kind == UNIT else None
        size_words = f": {size} in SI" if size is not None else ""
        yield f"{definition.kind} `{definition.token.text}`{size_words}\n\n```met\n{line}\n```"


def _of_values(index: DeckIndex, token: Token, entry: TextEntry | None, file: str) -> Iterator[str]:
    """The values that are written in the entry of a word, or at it."""
    lines = _lines(token, entry)
    values = [
        candidate
        for candidate in index.values
        if candidate.place is not None and _is_at(candidate.place, file, lines, token)
    ]
    for value in values[:MOST_VALUES]:
        yield _words(value)
    if len(values) > MOST_VALUES:
        yield f"and {len(values) - MOST_VALUES} more values are written here"


def _lines(token: Token, entry: TextEntry | None) -> tuple[tuple[int, int], tuple[int, int]]:
    """The begin and end of an entry, up to its block: lines and columns from 1."""
    words = entry.words if entry is not None and entry.words else [token]
    first, last = words[0].place, words[-1].place
    return (first.line, first.column), (last.line, last.column + last.length)


def _is_at(place: Place, file: str, lines: tuple[tuple[int, int], tuple[int, int]], token: Token) -> bool:
    return any(
        seen_place.file == file and lines[0] <= (seen_place.line, seen_place.column) < lines[1]
        for seen_place in {place, shown_place(place)}
    )


def _words(value: ValueInDeck) -> str:
    notes = "; ".join(value.origins)
    return (
        f"`{value.path}` = {value.value}"
        + (f"  \n{notes}" if notes else "")
        + (f"  \n{value.doc}" if value.doc else "")
    )


def markdown(paragraphs: Iterable[str]) -> str:
    """The paragraphs, separated by rules."""
    return "\n\n---\n\n".join(paragraphs)
