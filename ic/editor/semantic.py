"""The meaning of each word of a text, for an editor's colours: keys, models, units, names by what they name, macros.

A colour grammar uses only the spelling of a word; this module uses the declarations of the language and the definitions
of the deck.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

from lsprotocol import types

from ic.editor.names import NamesInTexts, models_called
from ic.editor.structure import LOOP, DeckText, TextEntry
from ic.language import BLOCKS
from ic.language.bodies import JOINT_KINDS
from ic.meaning.expressions.evaluate import FUNCTIONS
from ic.text.lexer import NAME, Token
from met.units import UNITS

TYPES = ("keyword", "property", "class", "function", "type", "enumMember", "macro", "parameter", "variable", "struct",
         "method")  # fmt: skip
"""The kinds of words, in the names of the protocol: a unit is a `type`, a model a `class`, a run a `method`."""

MODIFIERS = ("definition", "defaultLibrary")
LEGEND = types.SemanticTokensLegend(token_types=list(TYPES), token_modifiers=list(MODIFIERS))
DEFINES, OF_LIBRARY = 1, 2

_OF_NAME: Mapping[str, str] = MappingProxyType({
    "macro": "macro", "parameter": "parameter", "unit": "type", "link": "struct", "joint": "struct", "arm": "struct",
    "payload": "struct", "servo": "class", "run": "method", "sweep": "method", "search": "method", "tune": "method",
})  # fmt: skip


def semantic_tokens(
    text: DeckText, names: NamesInTexts, position: Callable[[int], types.Position], units: Callable[[str], int]
) -> types.SemanticTokens:
    """The meaningful words of a text, packed for the protocol.

    position of an offset, for the editor; units: the length of a text, for the editor
    """
    data: list[int] = []
    line = column = 0
    for token, kind, modifiers in meanings(text, names):
        start = position(token.offset)
        written = text.source.text[token.offset : token.end]
        if "\n" in written:
            continue
        if start.line != line:
            column = 0
        data += [start.line - line, start.character - column, units(written), TYPES.index(kind), modifiers]
        line, column = start.line, start.character
    return types.SemanticTokens(data)


def meanings(text: DeckText, names: NamesInTexts) -> Iterator[tuple[Token, str, int]]:
    """The words of a text in order, each with its kind of `TYPES` and bits of `MODIFIERS`; words without a meaning are
    left out."""
    entries = names.entries(text)
    loops = [entry for entry in entries if entry.kind == LOOP and entry.opened is not None and len(entry.words) > 1]
    in_lines = (token for line in text.directives for token in line.words)
    files = [(use.first.offset, use.last.offset) for use in text.uses]
    deck = (token for token in text.tokens if not any(first < token.offset < last for first, last in files))
    every = sorted((*deck, *in_lines), key=lambda token: token.offset)
    before: Token | None = None
    for n, token in enumerate(every):
        if token.kind == NAME:
            behind = every[n + 1].text if n + 1 < len(every) else ""
            meaning = _index(token, loops) or _meaning(text, token, names, before, behind)
            if meaning is not None:
                yield token, *meaning
        before = token


def _index(token: Token, loops: list[TextEntry]) -> tuple[str, int] | None:
    """The kind of a word that is the index of a loop around it; None where it is none."""
    for loop in loops:
        index = loop.words[1]
        if index.text == token.text and index.offset <= token.offset < loop.closed:
            return "parameter", DEFINES if index.offset == token.offset else 0
    return None


def _meaning(
    text: DeckText, token: Token, names: NamesInTexts, before: Token | None, behind: str
) -> tuple[str, int] | None:
    """The kind and the modifiers of a name of a text; None where it means nothing."""
    for definition in names.meant_in(text, token)[:1]:
        defines = definition.token.offset == token.offset and definition.file == text.source.name
        library = OF_LIBRARY if definition.file.startswith("<") else 0
        return _OF_NAME.get(definition.kind, "variable"), (DEFINES if defines else 0) | library
    if token.text in UNITS and before is not None and text.may_be_unit(token):
        return "type", 0
    entry = names.entry_at(text, token)
    if entry is None or entry.head is None:
        return None
    if token.text == "default" and token is entry.words[0] and token is not entry.head:
        return "keyword", 0
    if token.offset == entry.head.offset:
        return _key(token, entry, names)
    if token.text in ("like", "of", "from", "when", "in", "by", "and", "or", "not", "because") and behind != "=":
        return "keyword", 0
    if behind == "(" and token.text in FUNCTIONS:
        return "function", OF_LIBRARY
    if token.text in JOINT_KINDS and entry.kind == "joint":
        return "enumMember", 0
    if behind == "=" and "(" in entry.texts:
        return "property", 0
    if before is not None and before.text == ".":
        return "property", 0
    if models_called(token.text) and "=" in entry.texts:
        return "class", OF_LIBRARY
    declared = names.declared_in(entry.within).get(entry.kind)
    words = declared.parameter.words if declared is not None and declared.parameter is not None else ()
    return ("enumMember", 0) if token.text in words else None


def _key(token: Token, entry: TextEntry, names: NamesInTexts) -> tuple[str, int] | None:
    """The kind of the word that begins an entry: a property where it is a key without a block."""
    declared = names.declared_in(entry.within).get(token.text)
    if declared is None or entry.within is None:
        others = (LOOP, *BLOCKS) if entry.within is None else (LOOP, "remove")
        return ("keyword", 0) if declared is not None or token.text in others else None
    is_key = declared.form == "key" and (entry.opened is None or declared.written == declared.name)
    return ("property" if is_key else "keyword"), 0
