"""A deck's path to its tree: preprocessor and parser in turn, with all their messages.

A used deck has a preprocessor of its own, without macros of its user or of `-D`, and is parsed alone, in its own
edition and with its own units. Its runs and sweeps are left out.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ic.grammar.parse import Parsed, parse_on
from ic.grammar.syntax import NO_ROOFS, Deck, Entry, Group, Let, Roof, Roofs, UseEntry, Word
from ic.grammar.uses import under_roof, with_full_names
from ic.language import EXPERIMENTS, HEADS
from ic.text.files import DECK_IN_MEMORY, LIBRARY, NOTHING_UNSAVED, Files, FoundFile, Unsaved
from ic.text.lexer import COMMAND_LINE
from ic.text.limits import MOST_USED, Findings, GiveUp
from ic.text.preprocess import Tokens, find_file, preprocess_on, reached_by
from ic.text.source import SourceFile, UnreadableStretch
from met import units
from met.diagnostic import Diagnostic, Label, Problem
from met.messages.message import shown_place

TAKEN = (
    *HEADS, "J_eff", "arm", "b", "base", "duration", "energy", "integrator", "limits", "macro", "mode", "momentum",
    "pi", "q", "qd", "qdd", "reaction", "record", "seed", "servo", "servos", "signals", "tau", "tau_load",
)  # fmt: skip
"""Words with which other paths begin, or which are paths, and which so cannot be roofs."""


class UsedDecks:
    """Reads the decks that a deck uses, and those that these use in turn.

    complete, sound  whether all of them were read, and what could not be is where it belongs
    unreadable       the stretches that could not be read
    """

    def __init__(self, files: Files, findings: Findings) -> None:
        self._files, self._findings = files, findings
        self._looped = [0]
        self._used = 0
        self._count = 0
        self.complete = self.sound = True
        self.unreadable: list[UnreadableStretch] = []

    def parse(self, seen: Tokens, file: FoundFile, within: tuple[FoundFile, ...] = ()) -> tuple[Parsed, Roofs]:
        """A deck with the entries of its used decks, and its roofs; errors are in the findings.

        within  the decks that use it, the outermost first
        """
        self._count = seen.count
        parsed = parse_on(seen.tokens, self._findings, looped=self._looped)
        self.sound &= parsed.sound
        self.unreadable += parsed.unreadable
        own = {word.text: word for entry in parsed.entries for word in _defined(entry)}
        roofs: dict[str, Roof] = {}
        brought: list[Entry] = []
        for use in parsed.uses:
            if not self._may_be_called(use.roof, roofs, own):
                continue
            used_deck = self._used_deck(use, (*within, file))
            if used_deck is None:
                continue
            inner, inner_roofs = used_deck
            entries, left = under_roof(inner, use.roof.text, EXPERIMENTS)
            brought += entries
            roofs[use.roof.text] = Roof(use, left)
            roofs |= {f"{use.roof.text}.{name}": roof for name, roof in inner_roofs.items()}
        return replace(parsed, entries=(*brought, *with_full_names(parsed.entries, roofs))), roofs

    def _may_be_called(self, roof: Word, roofs: Roofs, own: dict[str, Word]) -> bool:
        """Return True if a roof may have this name; otherwise report the reason."""
        name = roof.text
        also: tuple[Label, ...] = ()
        if name in roofs:
            message, also = f"there is a roof `{name}` already", (Label(roofs[name].use.roof.place, "the first"),)
        elif name in own:
            message = f"`{name}` is defined in this deck, so no roof may be called so"
            also = (Label(own[name].place, "here"),)
        elif name in TAKEN:
            message = f"`{name}` begins paths of its own, so no roof may be called so"
        elif name in units.ALL_UNITS:
            message = f"`{name}` is the unit {units.ALL_UNITS[name].word}, so no roof may be called so"
        else:
            return True
        self._findings.error("D396", message, roof.place, also=also, help="give the roof another name")
        return False

    def _used_deck(self, use: UseEntry, within: tuple[FoundFile, ...]) -> tuple[Sequence[Entry], Roofs] | None:
        """The entries and roofs of a used deck; None where it cannot be read, which is reported."""
        self._used += 1
        if self._used > MOST_USED:
            self._findings.error("D018", f"more than {MOST_USED} decks are used", use.file_place)
            raise GiveUp
        includer = self._files.read_files.get(use.source, within[-1])
        file = find_file(self._files, self._findings, includer, use.file, use.angled, use.file_place)
        if file is None:
            return None
        chain = [deck_file.identity for deck_file in within]
        if file.identity in chain:
            loop = [*within[chain.index(file.identity) :], file]
            message = "a deck that uses itself: " + " uses ".join(f"`{deck_file.name}`" for deck_file in loop)
            help = "move what both need into a deck of its own, and use that"
            self._findings.error("D397", message, use.file_place, help=help)
            return None
        place = shown_place(use.file_place)
        included, used = ((place.file, place.line), *place.included), (0, *(n + 1 for n in place.used))
        try:
            self._files.text(file)
        except Problem as problem:
            self._findings.add(
                *(reached_by(diagnostic, use.file_place, included, used) for diagnostic in problem.diagnostics)
            )
            return None
        seen = preprocess_on(self._files, self._findings, lambda: file, included=included, used=used, count=self._count)
        if not seen.complete:
            self.complete = False
            raise GiveUp
        parsed, roofs = self.parse(seen, file, within)
        return parsed.entries, roofs


def _defined(entry: Entry) -> tuple[Word, ...]:
    """The name of a `let`, an arm or a servo."""
    if isinstance(entry, Let):
        return (entry.name,)
    if isinstance(entry, Group) and len(entry.words) == 2 and entry.words[0].text not in EXPERIMENTS:
        return (entry.words[1],)
    return ()


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
