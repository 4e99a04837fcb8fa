"""The names that a deck defines by its own words, such as `let` and `arm`, and not as macros."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from ic.text.lexer import NAME, STRING, Token
from met.frozen import frozen

VALUES = ("let", "param")
NAMING = (*VALUES, "arm", "link", "joint", "servo", "run", "sweep", "search", "tune", "unit", "as")
"""Words before a name that the deck defines, which no condition can see."""

MOST_IN_BRACES = 8  # tokens of one index


@frozen
class Named:
    """A name where it is defined: the number of its token in the deck, the word before it, and the token."""

    at: int
    word: str
    token: Token

    @property
    def what(self) -> str:
        if self.word in VALUES:
            return f"this `{self.word}` is a value"
        return f"this is the name of a {'used deck' if self.word == 'as' else f'`{self.word}`'}"


def names_in(tokens: Sequence[Token], asked: Iterable[str]) -> dict[str, Named]:
    """The names that a deck defines, each where it is defined first. Of the names that a loop makes, such as
    `let w{i}`, those that are asked for."""
    named: dict[str, Named] = {}
    looped: list[tuple[re.Pattern[str], Named]] = []
    for n in range(1, len(tokens)):
        word, token = tokens[n - 1], tokens[n]
        if token.kind != NAME or word.text not in NAMING:
            continue
        if word.text == "as" and not (n > 1 and (tokens[n - 2].kind == STRING or tokens[n - 2].text == ">")):
            continue
        found = Named(n, word.text, token)
        pattern = _pattern(tokens, n)
        if pattern == token.text:
            named.setdefault(token.text, found)
        else:
            looped.append((re.compile(pattern), found))
    for name in asked:
        for made, found in looped:
            if name not in named and made.fullmatch(name):
                named[name] = found
    return named


def _pattern(tokens: Sequence[Token], n: int) -> str:
    """A regular expression for the name at a token: `w\\w+` for `w{i}`, whose index stands close to it."""
    text, at = tokens[n].text, n + 1
    while at < len(tokens) and tokens[at].offset == tokens[at - 1].end and tokens[at].source is tokens[n].source:
        if tokens[at].text == "{":
            inside = [token.text for token in tokens[at + 1 : at + 2 + MOST_IN_BRACES]]
            if "}" not in inside[1:] or {"=", ";", "{"}.intersection(inside[: inside.index("}")]):
                break
            text, at = text + r"\w+", at + 2 + inside.index("}")
        elif tokens[at].kind == NAME and tokens[at - 1].text == "}":
            text, at = text + tokens[at].text, at + 1
        else:
            break
    return text
