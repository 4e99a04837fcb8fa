"""The stretch of text of an expression."""

from __future__ import annotations

from dataclasses import replace

from ic.grammar.syntax import Binary, Expression, Number, OverCases, Range, Unary, WithUnit
from met.diagnostic import Place


def place_of(expression: Expression) -> Place:
    """The stretch of an expression, as far as it is on one line."""
    match expression:
        case Number(unit=unit) if unit is not None:
            return spanned(expression.place, unit.place)
        case Unary():
            return spanned(expression.place, place_of(expression.operand))
        case Binary():
            left = expression.left
            while isinstance(left, Binary):
                left = left.left
            return spanned(place_of(left), place_of(expression.right))
        case WithUnit():
            return spanned(place_of(expression.inner), expression.unit.place)
        case OverCases():
            return spanned(place_of(expression.comparison), expression.place)
        case Range():
            return spanned(place_of(expression.first), place_of(expression.step))
    return expression.place


def spanned(first: Place, last: Place) -> Place:
    """The place from the first to the end of the last if both are on one line and came there by one way."""
    if (first.file, first.line, first.expansions) != (last.file, last.line, last.expansions):
        return first
    end = last.column + last.length
    return replace(first, length=end - first.column) if end > first.column else first
