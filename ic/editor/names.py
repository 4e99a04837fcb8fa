"""The names of a deck: where each is defined and used, in the texts of all its files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import lru_cache

from ic.editor.structure import LETS, DeckText, TextEntry
from ic.text.lexer import NAME, Token
from met.frozen import frozen

BASE_WORDS = {"like": None, "of": "run"}
"""Words that name a definition: of the same kind where it is None."""

_BRACES = re.compile(r"\{[^{}]*\}")

_KIND_OF_KEY = {"arm": "arm", "parent": "link", "child": "link"}


@lru_cache(maxsize=32)
def deck_text(name: str, text: str) -> DeckText:
    """The structure of a text; of one that is known, the same."""
    return DeckText(name, text)


@frozen
class NameInText:
    """A name that is defined: its kind (`servo`, `let`, `link`, `macro`), its token, and its entry if it has one."""

    kind: str
    token: Token
    entry: TextEntry | None

    @property
    def file(self) -> str:
        return self.token.source.name


class NamesInTexts:
    """The definitions of some texts, by name."""

    def __init__(self, texts: Iterable[DeckText]) -> None:
        self.texts = tuple(texts)
        self.by_name: dict[str, list[NameInText]] = {}
        for text in self.texts:
            for each in _defined(text):
                self.by_name.setdefault(each.token.text, []).append(each)

    def of_kind(self, *kinds: str) -> list[str]:
        """The names of these kinds, each once."""
        return [name for name, found in self.by_name.items() if any(each.kind in kinds for each in found)]

    def meant(self, token: Token, entry: TextEntry | None) -> list[NameInText]:
        """The definitions that a word in an entry means: those of the kind that is wanted there, or else all."""
        found = self.by_name.get(token.text) or self._made_by_loops(token.text)
        if any(each.token is token for each in found):
            return [each for each in found if each.token is token]
        wanted = _wanted(token, entry)
        of_kind = [each for each in found if each.kind in wanted]
        return of_kind or found

    def _made_by_loops(self, name: str) -> list[NameInText]:
        """The definitions whose names with braces may be this one: `seg_{i}` of `seg_7` and of `seg_{i-1}`."""
        plain = _BRACES.sub("0", name)
        return [
            each
            for written, found in self.by_name.items()
            if "{" in written and re.fullmatch(_BRACES.sub(r"\\w+", written), plain)
            for each in found
        ]

    def uses(self, name: str) -> Iterator[Token]:
        """All tokens of a name in the texts, those that define it too."""
        for text in self.texts:
            lines = (token for line in text.directives if line.name != "include" for token in line.tokens[2:])
            for token in (*text.tokens, *lines):
                if token.kind == NAME and token.text == name:
                    yield token

    def model_of(self, entry: TextEntry) -> str:
        """The model that a servo or a metric is of, through what it is `like`; "" where that is not said."""
        for _ in range(16):
            for inner in entry.entries:
                if inner.kind == "model" and len(inner.words) > 2:
                    return inner.words[2].text
            if "=" in entry.texts:
                return entry.word_behind("=")
            base = entry.word_behind("like")
            found = [each for each in self.by_name.get(base, ()) if each.kind == entry.kind and each.entry]
            if not found or found[0].entry is entry:
                return ""
            assert found[0].entry is not None
            entry = found[0].entry
        return ""


def _defined(text: DeckText) -> Iterator[NameInText]:
    for entry in text.all_entries():
        name = entry.named
        if name is not None:
            yield NameInText("let" if entry.kind in LETS else entry.kind, name, entry)
    for line in text.directives:
        if line.name == "define" and len(line.tokens) > 2:
            yield NameInText("macro", line.tokens[2], None)


def _wanted(token: Token, entry: TextEntry | None) -> tuple[str, ...]:
    """The kinds of definitions that a word may mean where it stands."""
    if entry is None:
        return ()
    words = entry.words
    at = next((i for i, word in enumerate(words) if word is token or word.offset == token.offset), None)
    if at is None:
        return ()
    before = words[at - 1].text if at else ""
    if before in BASE_WORDS:
        return (BASE_WORDS[before] or entry.kind,)
    if before == "=" and at >= 2:
        key = words[at - 2].text
        around = entry.within.kind if entry.within is not None else ""
        return ("servo",) if around == "servos" else (_KIND_OF_KEY.get(key, "let"),)
    if before == ".":
        return ("link", "payload") if at >= 2 and words[at - 2].text == "links" else ("joint", "metric")
    if at + 1 < len(words) and words[at + 1].text == ".":
        return ("joint", "servo", "arm")
    return ("macro", "let", "metric", "joint")
