"""The names that a deck defines by its own words, such as `let` and `arm`, and not as macros."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from ic.text.lexer import NAME, STRING, Token
from met.frozen import frozen

VALUES = ("let", "param")
NAMING = (*VALUES, "arm", "link", "joint", "loop", "servo", "run", "sweep", "search", "tune", "unit", "as")
"""Words before a name that the deck defines, which no condition can see."""

MOST_IN_BRACES = 8  # tokens of one index


@frozen
class Named:
    """A name where it is defined: the number of its token in the deck, the word before it, and the token."""

    number: int
    word: str
    token: Token

    @property
    def what(self) -> str:
        if self.word in VALUES:
            return f"this `{self.word}` is a value"
        return f"this is the name of a {'used deck' if self.word == 'as' else f'`{self.word}`'}"


def names_in(tokens: Sequence[Token], names: Iterable[str]) -> dict[str, Named]:
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
        definition = Named(n, word.text, token)
        pattern = _pattern(tokens, n)
        if pattern == token.text:
            named.setdefault(token.text, definition)
        else:
            looped.append((re.compile(pattern), definition))
    for name in names:
        for loop_pattern, definition in looped:
            if name not in named and loop_pattern.fullmatch(name):
                named[name] = definition
    return named


def _pattern(tokens: Sequence[Token], n: int) -> str:
    """A regular expression for the name at a token: `w\\w+` for `w{i}`, whose index stands close to it."""
    text, position = tokens[n].text, n + 1
    while (
        position < len(tokens)
        and tokens[position].offset == tokens[position - 1].end
        and tokens[position].source is tokens[n].source
    ):
        if tokens[position].text == "{":
            inside = [token.text for token in tokens[position + 1 : position + 2 + MOST_IN_BRACES]]
            if "}" not in inside[1:] or {"=", ";", "{"}.intersection(inside[: inside.index("}")]):
                break
            text, position = text + r"\w+", position + 2 + inside.index("}")
        elif tokens[position].kind == NAME and tokens[position - 1].text == "}":
            text, position = text + tokens[position].text, position + 1
        else:
            break
    return text
