"""Macros in a deck's texts: the expansion of their uses, and the place in the deck of their bodies.

This is the preprocessor for names alone. It accepts incomplete texts, ignores conditions, and gives up early: for an
editor, a missing name is better than no answer.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from ic.editor.structure import (
    DeckText,
    TextEntry,
    TextMacro,
    entries_of,
    flattened,
    innermost_around,
    with_whole_names,
)
from ic.text.lexer import NAME, PASTE, Token

MOST_TOKENS = 20_000
"""Largest number of tokens to which the uses of macros in a text expand."""


class MacrosInTexts:
    """The macros of some texts, their uses, and the entries that these make."""

    def __init__(self, texts: Sequence[DeckText]) -> None:
        self._texts = texts
        self.by_name: dict[str, list[TextMacro]] = {}
        for text in texts:
            for macro in text.macros:
                self.by_name.setdefault(macro.name.text, []).append(macro)
        self._uses = dict(self._first_uses()) if self.by_name else {}
        self._bodies: dict[int, list[TextEntry]] = {}

    def meant(self, use: Token) -> TextMacro | None:
        """The macro that a token uses: the last that its text defines before it, or else any."""
        macros = self.by_name.get(use.text, ())
        before = [macro for macro in macros if macro.name.source is use.source and macro.name.offset <= use.offset]
        return before[-1] if before else macros[-1] if macros else None

    @staticmethod
    def at(text: DeckText, offset: int) -> TextMacro | None:
        """The macro in whose body, or on whose line after it, an offset of a text is."""
        for macro in text.macros:
            begin = macro.body[0].offset if macro.body else macro.end + 1
            behind = text.source.text[macro.end : offset]
            if begin <= offset and (offset <= macro.end or not behind.strip(" \t")):
                return macro
        return None

    def body(self, macro: TextMacro) -> list[TextEntry]:
        """The entries of a macro's body, inside of what stands around its first use."""
        key = id(macro)
        if key not in self._bodies:
            self._bodies[key] = []  # for a macro that uses itself
            self._bodies[key] = entries_of(macro.body, macro.end, self._around_use(macro))
        return self._bodies[key]

    def _around_use(self, macro: TextMacro) -> TextEntry | None:
        text, use = self._uses.get(macro.name.text, (None, None))
        if text is None or use is None:
            return None
        inside = self.at(text, use.offset)
        if inside is None:
            return text.around(use.offset)
        body = self.body(inside)
        return innermost_around(body, use.offset) or (body[0].within if body else self._around_use(inside))

    def _first_uses(self) -> Iterator[tuple[str, tuple[DeckText, Token]]]:
        """The first use of each macro; one in a body only where there is no other."""
        for in_bodies in (True, False):
            for text in reversed(self._texts):
                lines = (token for macro in text.macros for token in macro.body)
                for token in reversed(list(lines) if in_bodies else text.tokens):
                    if token.text in self.by_name:
                        yield token.text, (text, token)

    def entries_in(self, text: DeckText) -> Iterator[TextEntry]:
        """The entries that uses of macros make in a text, where the use is an entry, or begins one."""
        room = TokensLeft(MOST_TOKENS)
        for entry in text.all_entries():
            if entry.words and entry.words[0].text in self.by_name:
                tokens = self.expanded(entry.words, room)
                yield from flattened(entries_of(with_whole_names(tokens), entry.closed, entry.within))

    def expanded(self, tokens: Sequence[Token], room: TokensLeft, within: frozenset[str] = frozenset()) -> list[Token]:
        """The tokens that others become, each where it was written: in a body, or in an argument.

        within  the macros whose bodies these are of: they are not used again
        """
        expansion: list[Token] = []
        index = 0
        while index < len(tokens) and room.left > 0:
            token = tokens[index]
            index += 1
            room.left -= 1
            macro = self.meant(token) if token.kind == NAME and token.text not in within else None
            if macro is None:
                expansion.append(token)
            elif macro.parameters is None:
                expansion += self.expanded(pasted(macro.body), room, within | {token.text})
            elif index < len(tokens) and tokens[index].text == "(":
                arguments, index = arguments_at(tokens, index)
                by_parameter = dict(zip((parameter.text for parameter in macro.parameters), arguments, strict=False))
                expansion += self.expanded(pasted(_filled(macro.body, by_parameter)), room, within | {token.text})
            else:
                expansion.append(token)
        return expansion


@dataclass
class TokensLeft:
    """The number of tokens that may still be made."""

    left: int


def arguments_at(tokens: Sequence[Token], index: int) -> tuple[list[list[Token]], int]:
    """The arguments in the parentheses that begin at an index, and the index after them."""
    arguments: list[list[Token]] = [[]]
    depth = 0
    while index < len(tokens):
        token = tokens[index]
        index += 1
        depth += (token.text == "(") - (token.text == ")")
        if depth == 0:
            break
        if depth == 1 and token.text == ",":
            arguments.append([])
        elif depth > 1 or token.text != "(":
            arguments[-1].append(token)
    return arguments, index


def _filled(body: Iterable[Token], arguments: Mapping[str, list[Token]]) -> Iterator[Token]:
    for token in body:
        if token.kind == NAME and token.text in arguments:
            yield from arguments[token.text]
        else:
            yield token


def pasted(tokens: Iterable[Token]) -> list[Token]:
    """The tokens with `##` carried out; a joined token stands at the place of its first part."""
    joined: list[Token] = []
    joins = False
    for token in tokens:
        if token.kind == PASTE:
            joins = bool(joined)
        elif joins:
            first = joined.pop()
            joined.append(Token(NAME, first.text + token.text, first.source, first.offset, first.length))
            joins = False
        else:
            joined.append(token)
    return joined
