"""The decks that a deck uses, `use <panda.ic> as panda;`: each read by itself, its definitions under its roof.

A used deck has a preprocessor of its own, without macros of its user or of `-D`, and is parsed alone, in its own
edition and with its own units. Its runs and sweeps are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ic.grammar.parse import Parsed, parse_on
from ic.grammar.roofs import under_roof, with_full_names
from ic.grammar.syntax import Entry, Group, Let, Roof, Roofs, UseEntry, Word
from ic.language import EXPERIMENTS, HEADS
from ic.text.files import Files, FoundFile
from ic.text.limits import MOST_USED, Findings, GiveUp
from ic.text.preprocess import Tokens, find_file, preprocess_on, reached_by
from ic.text.source import UnreadableStretch
from met import units
from met.diagnostic import Label, Problem
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
