"""Decks that a text uses: the texts in which a name may be defined, with roofs before it and without."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence

from ic.editor.structure import DeckText
from ic.grammar.uses import AS, USE
from ic.text.lexer import NAME, STRING, Token
from met.frozen import frozen

DEFINED = ("let", "servo", "arm")
"""The kinds of names that stand under a roof."""

_INCLUDE = re.compile(r'[ \t]*#[ \t]*include[ \t]*(?:"([^"\n]*)"|<([^>\n]*)>)', re.MULTILINE)
_USE = re.compile(rf'\b{USE}\s*(?:"([^"\n]*)"|<([^>\n]*)>)\s*{AS}\b')


@frozen
class UseInText:
    """`use <panda.ic> as panda;` in a text: the file as it is asked for, the tokens around its name, and the roof's."""

    file: str
    angled: bool
    first: Token
    last: Token
    roof: Token


def uses_in(text: DeckText) -> Iterator[UseInText]:
    """The uses of decks in a text, as far as they are complete."""
    for entry in text.entries:
        words = entry.words
        end = next((n for n, word in enumerate(words) if word.text == AS), 0)
        if not words or words[0].text != USE or end < 2 or len(words) <= end + 1 or words[end + 1].kind != NAME:
            continue
        first, last = words[1], words[end - 1]
        if first.kind != STRING and (first.text, last.text) != ("<", ">"):
            continue
        file = text.source.text[first.offset + 1 : last.end - 1]
        yield UseInText(file, first.text == "<", first, last, words[end + 1])


def used_files(text: str) -> set[str]:
    """The names, without folders, of the files that a text uses, whose runs do not belong to the deck."""
    return {os.path.basename(quoted or angled) for quoted, angled in _USE.findall(text)}


class DecksUsed:
    """Which texts a name may be of: those that includes connect, and behind roofs those that these stand for.

    A text that no other one is seen to include or use, for a macro names its file, counts as a part of the first.
    """

    def __init__(self, texts: Sequence[DeckText]) -> None:
        self._uses = {text.source.name: list(uses_in(text)) for text in texts}
        self._beside: dict[str, set[str]] = {name: set() for name in self._uses}  # includes, or is included by
        reached: set[str] = set()
        for text in texts if any(self._uses.values()) else ():
            including = text.source.name
            for quoted, angled in _INCLUDE.findall(text.source.text):
                for other in self._called(quoted or angled) - {including}:
                    self._beside[including].add(other)
                    self._beside[other].add(including)
                    reached.add(other)
            reached.update(*(self._called(use.file) for use in self._uses[including]))
        for name in list(self._uses)[1:]:
            if name not in reached:
                self._beside[name].add(texts[0].source.name)
                self._beside[texts[0].source.name].add(name)

    def __bool__(self) -> bool:
        """True where a text uses a deck."""
        return any(self._uses.values())

    def _called(self, file: str) -> set[str]:
        """The texts that a file's name may mean."""
        pattern = re.compile(rf"<?(?:.*/)?{re.escape(file.removeprefix('./'))}>?")
        return {name for name in self._uses if pattern.fullmatch(name)}

    def seen_from(self, name: str) -> set[str]:
        """The texts whose definitions a text sees without a roof, including itself."""
        return self._connected({name}) if self else set(self._uses)

    def _connected(self, names: Iterable[str]) -> set[str]:
        connected: set[str] = set()
        waiting = set(names)
        while waiting:
            name = waiting.pop()
            connected.add(name)
            waiting |= self._beside.get(name, set()) - connected
        return connected

    def roofs(self, names: Iterable[str]) -> dict[str, UseInText]:
        """The roofs that some texts have."""
        return {use.roof.text: use for name in names for use in self._uses.get(name, ())}

    def under(self, name: str, words: Sequence[str]) -> set[str]:
        """The texts for which roofs in a text stand, `cell`, `panda` in `cell.panda.d1`; none where one is not a
        roof."""
        seen = self.seen_from(name)
        for word in words:
            use = self.roofs(seen).get(word)
            seen = self._connected(self._called(use.file)) if use is not None else set()
        return seen
