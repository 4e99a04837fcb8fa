"""Names with braces in them, `seg_{i-1}`, and the whole numbers that braces and the ends of a loop hold.

What stands in braces is an index of a loop or whole numbers with `+ - * / %` and brackets; nothing that a block may
hold looks so, since entries have a `;`. The opening brace touches the name before it, and where there is none, what
follows it: `seg_{ i }` is a name and so is `{i}`, and `{ i }_seg`, whose end shows it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ic.text.lexer import NAME, WHOLE, Token
from ic.text.limits import CONDITION_NESTING, LONGEST_NAME

USAGE = "a loop is written `for i in 1 .. 6 { ... }`, with `by 2` or without, or `for side in [left, right] { ... }`"
LARGEST = 10**9
_FAR = 1_000  # characters between two tokens: of a macro's body and of an argument, surely
_SIGNS = ("+", "-", "*", "/", "%", "(", ")")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class NotWhole(Exception):
    """Raised where a whole number is expected and missing: the token, the fault, and the remedy."""

    def __init__(self, token: Token, message: str, help: str = "") -> None:
        super().__init__(message)
        self.token, self.message, self.help = token, message, help


class NoName(Exception):
    """Raised where braces do not make a name: the text that they make."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.text = text


def adjacent(first: Token, second: Token) -> bool:
    """Return True if nothing stands between two tokens in the text."""
    return first.source is second.source and first.end == second.offset


def _may_touch(first: Token, second: Token) -> bool:
    """Return True if two tokens touch, or a macro may have put an argument between or beside them: then they count as
    touching."""
    if adjacent(first, second) or not second.expansions:
        return adjacent(first, second)
    apart = second.offset - first.end
    if first.source is not second.source or not 0 < apart < _FAR:
        return True
    return first.source.text[first.end : second.offset].strip() != ""


def braces_length(tokens: Sequence[Token], position: int, *, touching: bool = False) -> int:
    """The number of tokens of the braces at token `position` that belong to a name; 0 where there are none, or a block.

    touching  whether the opening brace touches what follows it
    """
    if tokens[position].text != "{" or position + 2 >= len(tokens):
        return 0
    if touching and not _may_touch(tokens[position], tokens[position + 1]):
        return 0
    end = position + 1
    while end < len(tokens) and (tokens[end].kind in (NAME, WHOLE) or tokens[end].text in _SIGNS):
        end += 1
    closed = position + 1 < end < len(tokens) and tokens[end].text == "}"
    return end + 1 - position if closed else 0


def name_length(tokens: Sequence[Token], position: int) -> int:
    """The number of tokens of the name that begins at token `position`, braces included; 0 where none begins there."""
    end = position + (1 if tokens[position].kind == NAME else _leading_length(tokens, position))
    while position < end < len(tokens):
        before, token = tokens[end - 1 : end + 1]
        more = braces_length(tokens, end) if _may_touch(before, token) else 0
        if before.text == "}" and token.kind in (NAME, WHOLE) and adjacent(before, token):
            more = 1
        if not more:
            break
        end += more
    return end - position


def _leading_length(tokens: Sequence[Token], position: int) -> int:
    """The number of tokens of the braces at token `position` that a name begins with; 0 where a block begins."""
    length = braces_length(tokens, position)
    if length and position and tokens[position - 1].text == "." and adjacent(tokens[position - 1], tokens[position]):
        return length  # `bodies.{ side }.mass`: behind a point stands a name
    if length and position + length < len(tokens):
        before, after = tokens[position + length - 1 : position + length + 1]
        if after.kind in (NAME, WHOLE) and adjacent(before, after):
            return length
    return braces_length(tokens, position, touching=True)


def filled(tokens: Sequence[Token], known: Mapping[str, str]) -> str:
    """The name of these tokens, with indices replaced by their values in `known`. Raises NotWhole, NoName."""
    text, position = "", 0
    while position < len(tokens):
        length = braces_length(tokens, position)
        if not length:
            text, position = text + tokens[position].text, position + 1
            continue
        inside = tokens[position + 1 : position + length]
        if len(inside) == 2 and _NAME.fullmatch(known.get(inside[0].text, "")):
            text += known[inside[0].text]
        else:
            number, end = whole(inside, 0, known)
            if end != len(inside) - 1:
                raise NotWhole(inside[end], f"`{inside[end].text}` does not belong here")
            text += str(number)
        position += length
    if len(text) > LONGEST_NAME or not _NAME.fullmatch(text):
        raise NoName(text)
    return text


def whole(tokens: Sequence[Token], position: int, known: Mapping[str, str], depth: int = 0) -> tuple[int, int]:
    """The whole number that begins at token `position`, and where it ends; a token is behind it. Raises NotWhole."""
    value, position = _product(tokens, position, known, depth)
    while tokens[position].text in ("+", "-"):
        sign = tokens[position]
        other, position = _product(tokens, position + 1, known, depth)
        value = _bounded(value + other if sign.text == "+" else value - other, sign)
    return value, position


def _product(tokens: Sequence[Token], position: int, known: Mapping[str, str], depth: int) -> tuple[int, int]:
    """The whole number of the product that begins at token `position` (`*`, `/`, `%`), and the position of the token
    behind it. Raises NotWhole."""
    value, position = _factor(tokens, position, known, depth)
    while tokens[position].text in ("*", "/", "%"):
        sign = tokens[position]
        other, position = _factor(tokens, position + 1, known, depth)
        if sign.text == "*":
            value = _bounded(value * other, sign)
        elif other == 0:
            raise NotWhole(sign, "division by zero")
        elif sign.text == "%":
            value %= other
        elif value % other:
            raise NotWhole(sign, f"{value}/{other} is not a whole number", "`%` is the rest of a division")
        else:
            value //= other
    return value, position


def _factor(tokens: Sequence[Token], position: int, known: Mapping[str, str], depth: int) -> tuple[int, int]:
    """The whole number of the factor at token `position` (a number, a name in `known`, a sign or brackets), and the
    position of the token behind it. depth: of signs and brackets around it. Raises NotWhole."""
    token = tokens[position]
    if depth > CONDITION_NESTING:
        raise NotWhole(token, f"signs and brackets go deeper than {CONDITION_NESTING} here")
    if token.text in ("-", "+"):
        value, position = _factor(tokens, position + 1, known, depth + 1)
        return -value if token.text == "-" else value, position
    if token.text == "(":
        value, position = whole(tokens, position + 1, known, depth + 1)
        if tokens[position].text != ")":
            raise NotWhole(tokens[position], "a `)` is missing before this")
        return value, position + 1
    if token.kind == WHOLE and token.text.isdigit() and len(token.text) <= len(str(LARGEST)):
        return _bounded(int(token.text), token), position + 1
    text = known.get(token.text) if token.kind == NAME else None
    if text is None:
        raise NotWhole(token, "")
    if _NAME.fullmatch(text):
        raise NotWhole(token, f"`{token.text}` is a name here, `{text}`, and a whole number is needed")
    return int(text), position + 1


def _bounded(value: int, token: Token) -> int:
    if abs(value) > LARGEST:
        raise NotWhole(token, f"whole numbers of a loop go to {LARGEST:,} at most")
    return value
