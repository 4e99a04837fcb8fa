"""The outline of a text, and the stretches that fold in it: definitions, blocks, comments, `#if`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType

from lsprotocol import types

from ic.editor.structure import LOOP, DeckText, TextEntry, through_loops
from ic.language import BLOCKS
from ic.text.lexer import Token
from ic.text.limits import DEPTH

Position = Callable[[int], types.Position]
"""A function that gives the position of an offset of a text."""

Fold = tuple[int, int, types.FoldingRangeKind | None]
"""First and last line of a stretch, counted from 0, and its kind; one whose last line is not below folds nothing."""

_KINDS: Mapping[str, types.SymbolKind] = MappingProxyType({
    "arm": types.SymbolKind.Class, "servo": types.SymbolKind.Class, "link": types.SymbolKind.Struct,
    "joint": types.SymbolKind.Field, "run": types.SymbolKind.Function, "sweep": types.SymbolKind.Array,
    "search": types.SymbolKind.Array, "tune": types.SymbolKind.Array, "let": types.SymbolKind.Variable,
    "param": types.SymbolKind.Variable, "unit": types.SymbolKind.Constant,
    "metric": types.SymbolKind.Property, "require": types.SymbolKind.Boolean,
})  # fmt: skip


def symbols(text: DeckText, position: Position) -> list[types.DocumentSymbol]:
    """The definitions of a text, those of a block below it, and its macros."""
    all_symbols = list(_symbols(text.entries, position))
    for directive in text.directives:
        if directive.name == "define" and len(directive.tokens) > 2:
            name = directive.tokens[2]
            whole = types.Range(position(directive.tokens[0].offset), position(directive.tokens[-1].end))
            own = types.Range(position(name.offset), position(name.end))
            all_symbols.append(types.DocumentSymbol(name.text, types.SymbolKind.Constant, whole, own, "#define"))
    return sorted(all_symbols, key=lambda symbol: (symbol.range.start.line, symbol.range.start.character))


def _symbols(entries: Iterable[TextEntry], position: Position, levels: int = DEPTH) -> Iterator[types.DocumentSymbol]:
    """The definitions among some entries, with those in their blocks as deep as a deck may go."""
    for entry in through_loops(entries):
        name = entry.named
        if entry.kind == LOOP and entry.opened is not None:
            continue
        if name is None and (entry.opened is None or entry.kind not in BLOCKS):
            continue
        title = name if name is not None else entry.words[0]
        yield types.DocumentSymbol(
            title.text,
            _KINDS.get(entry.kind, types.SymbolKind.Object),
            types.Range(position(entry.words[0].offset), position(max(entry.closed, title.end))),
            types.Range(position(title.offset), position(title.end)),
            detail=" ".join(text for text in entry.texts if text != title.text)[:80] or None,
            children=list(_symbols(entry.entries, position, levels - 1)) if levels else [],
        )


def folds(text: DeckText) -> list[types.FoldingRange]:
    """The stretches of lines that fold: blocks, comments of several lines, conditionals, runs of includes."""
    line = text.source.line
    all_folds: list[Fold] = [
        (line(entry.opened.offset) - 1, line(max(entry.closed - 1, 0)) - (2 if entry.complete else 1), None)
        for entry in text.all_entries()
        if entry.opened is not None
    ]
    all_folds += _folded_comments(text.comments, line)
    all_folds += _folded_conditionals(text, line)
    several = sorted((fold for fold in all_folds if fold[1] > fold[0]), key=lambda fold: fold[:2])
    return [types.FoldingRange(first, last, kind=kind) for first, last, kind in several]


def _folded_comments(comments: list[Token], line: Callable[[int], int]) -> Iterator[Fold]:
    """A fold for each run of comments on lines one after the other."""
    runs: list[tuple[int, int]] = []
    for token in comments:
        first, last = line(token.offset) - 1, line(token.end - 1) - 1
        if runs and first <= runs[-1][1] + 1:
            runs[-1] = runs[-1][0], last
        else:
            runs.append((first, last))
    for first, last in runs:
        yield first, last, types.FoldingRangeKind.Comment


def _folded_conditionals(text: DeckText, line: Callable[[int], int]) -> Iterator[Fold]:
    """The stretches between `#if`, `#else` and `#endif`, as numbers of their first and last lines."""
    opened: list[int] = []
    for directive in text.directives:
        line_number = line(directive.tokens[0].offset) - 1
        if directive.name.startswith("if"):
            opened.append(line_number)
        elif directive.name.startswith(("el", "end")) and opened:
            yield opened.pop(), line_number - 1, types.FoldingRangeKind.Region
            if directive.name != "endif":
                opened.append(line_number)
