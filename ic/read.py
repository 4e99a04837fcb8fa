"""A deck's path to its tree: preprocessor and parser in turn, with all their messages."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from ic.grammar.parse import Parsed
from ic.grammar.syntax import NO_ROOFS, Deck
from ic.text.files import DECK_IN_MEMORY, LIBRARY, NOTHING_UNSAVED, Files, FoundFile, Unsaved
from ic.text.lexer import COMMAND_LINE
from ic.text.limits import Findings, GiveUp
from ic.text.preprocess import preprocess_on
from ic.text.source import SourceFile
from ic.used_decks import UsedDecks
from met.diagnostic import Diagnostic, Problem
from met.messages.message import shown_place

UNKNOWN_TEXT = (
    "D001", "D002", "D005", "D006", "D007", "D008", "D009", "D010", "D014", "D016", "D018",
    "D395", "D396", "D397",
)  # fmt: skip
"""Errors after which the deck's text is not fully known: a file or a branch of it may be missing."""


def read(
    path: str | Path,
    include_dirs: Sequence[str | Path] = (),
    defines: Sequence[str] = (),
    *,
    library: Path = LIBRARY,
    despite_errors: bool = False,
    text: str | None = None,
    unsaved: Unsaved = NOTHING_UNSAVED,
) -> Deck:
    """The deck at `path`, or the standard library's of that name where there is no such file.

    include_dirs  further directories for `#include`, and for other files that the deck names
    defines       macros, `NAME` or `NAME=VALUE`
    text          of the deck, where it is in no file: then `path` counts for nothing
    unsaved       texts in place of what files hold, by the files' real paths
    despite_errors  also where errors are found, as long as what is not wrong could be read: `Deck.unreadable`

    Raises Problem with every error and warning found, in the order of the text, and the text of every file read.
    """
    files = Files(include_dirs, library, unsaved)
    findings = Findings()
    used = UsedDecks(files, findings)
    file = files.deck(path) if text is None else None
    seen = preprocess_on(files, findings, lambda: file or files.in_memory(text or ""), defines)
    parsed, roofs = Parsed(), NO_ROOFS
    if seen.complete:
        with suppress(GiveUp):
            parsed, roofs = used.parse(seen, file or FoundFile(DECK_IN_MEMORY, DECK_IN_MEMORY))
    sources = (*files.read_so_far.values(), *(source for source in seen.sources if source.name == COMMAND_LINE))
    diagnostics = in_order(findings.all, sources)
    complete = seen.complete and used.complete
    sound = used.sound and despite_errors and not any(error.code in UNKNOWN_TEXT for error in findings.errors)
    if not complete or (findings.errors and not sound):
        raise Problem(diagnostics, {source.name: source.text for source in sources})
    return Deck(
        sources[0].name,
        parsed.entries,
        sources,
        diagnostics,
        tuple(os.fspath(include_dir) for include_dir in include_dirs),
        os.fspath(path),
        tuple(defines),
        tuple(used.unreadable),
        text,
        unsaved,
        parsed.units,
        roofs,
    )


def read_again(deck: Deck, defines: Sequence[str], *, library: Path = LIBRARY) -> Deck:
    """A deck read again with further macros, `NAME=VALUE`, which replace those of their names on the command line."""
    names = {define.partition("=")[0] for define in defines}
    other_defines = [define for define in deck.defines if define.partition("=")[0] not in names]
    return read(
        deck.path, deck.include_dirs, (*other_defines, *defines), library=library, text=deck.text, unsaved=deck.unsaved
    )


def in_order(diagnostics: Iterable[Diagnostic], sources: Sequence[SourceFile]) -> tuple[Diagnostic, ...]:
    """Diagnostics in the order of the files' text; those without a place come last."""
    number = {source.name: i for i, source in enumerate(sources)}

    def key(diagnostic: Diagnostic) -> tuple[int, int, int]:
        if diagnostic.at is None:
            return (len(number) + 1, 0, 0)
        place = shown_place(diagnostic.at.place)
        return (number.get(place.file, len(number)), place.line, place.column)

    return tuple(sorted(diagnostics, key=key))
