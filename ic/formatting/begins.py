"""The beginning of a row: a new entry, the continuation of one, or a place below the text after a bracket."""

from __future__ import annotations

from ic.formatting.row import Row
from ic.text.lexer import NUMBERS, STRING

_JOINING = frozenset(("+", "-", "*", "/", "^", "=", "+=", "<", "<=", ">", ">=", "==", "!=", "..", "and", "or", "by"))
_LEFT_OPEN = _JOINING | {"not", "when", "like", "of"}


def stands_below(row: Row) -> bool:
    """Return True if a row was written below the text after its bracket."""
    if row.parent is None or row.closes is not None:
        return False
    outer, opener = row.parent
    following = outer.pieces[opener + 1 : opener + 2]
    if outer.exact or not following or outer.pieces[opener].text == "{" or following[0].kind == "comment":
        return False
    return row.column(row.whole[0].offset) == following[0].column


def _sets_others(row: Row) -> bool:
    """Return True for `* = spindle;`."""
    return [piece.text for piece in row.pieces[:2]] == ["*", "="]


def goes_on(row: Row) -> bool:
    """Return True if a row continues the one before without a bracket that says so."""
    behind = row.behind
    if row.closes is not None or stands_below(row):
        return False
    if behind is None or behind.text in (";", ",", "}"):
        joining = bool(row.pieces) and row.pieces[0].text in _JOINING and not _sets_others(row)
        return behind is not None and behind.text == "}" and joining
    if behind.text in _LEFT_OPEN:
        return True
    if not row.pieces:
        return False
    first = row.pieces[0]
    if _sets_others(row):
        return False
    return first.text in _JOINING or first.text in ("(", "[") or first.tokens[0].kind in (STRING, *NUMBERS)
