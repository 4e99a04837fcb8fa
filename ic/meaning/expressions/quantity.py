"""A quantity, or a list of them: SI numbers with their dimension, each knowing where it was written.

A number may be a recorded scalar, where a sweep varies what it depends on; then what comes of it is recorded too.
"""

from __future__ import annotations

import math
from typing import cast

from ic.grammar.syntax import Unit
from met import units
from met.diagnostic import Place, Problem, error
from met.frozen import frozen
from met.messages import other_units
from met.trace import Real, Scalar
from met.units import PURE, Dimension


@frozen
class Value:
    """A quantity: number in SI, dimension. bare: a number written with no unit. unit: the one it was written in.

    decimal  of a bare number that is written out, its digits as written
    hertz    the exponent of the hertz in its unit; None where a factor of pi may be there to change cycles to radians
    """

    number: Real
    dimension: Dimension
    place: Place
    bare: bool = False
    unit: Unit | None = None
    decimal: str = ""
    hertz: int | None = 0


@frozen
class ValueList:
    """A list of quantities."""

    items: tuple[Value | ValueList, ...]
    place: Place
    unit: Unit | None = None


def measure_of(unit: Unit) -> units.Measure:
    """The measure of a unit. Raises D074 where a factor is not a unit."""
    declared = dict(unit.declared)
    for word, _ in unit.factors:
        if word.text not in units.ALL_UNITS and word.text not in declared:
            raise Problem(error("D074", f"`{word.text}` is not a unit", word.place, help=other_units.remedy(word.text)))
    try:
        measure = units.measure(((word.text, exponent) for word, exponent in unit.factors), declared)
        if measure.scale == 0.0:
            raise OverflowError
    except OverflowError:
        raise Problem(error("D067", "this unit is beyond what a number can hold", unit.place)) from None
    return measure


def unit_of_plan(unit: Unit | None) -> Unit | None:
    """The unit in which a plan may show a value: the deck's; None, for SI, where the deck declares a part of it."""
    return None if unit is None or unit.declared else unit


def in_unit(value: Value, unit: Unit) -> Value:
    """A pure number in a unit, rounded once. Raises D067 where it is too large in SI, or so small that it would be
    0."""
    measure = measure_of(unit)
    in_si = measure.to_si(cast(float, value.number), value.decimal)  # a scalar divides and multiplies too
    number = representable(in_si, value.place, value.number)
    return Value(number, measure.dimension, value.place, unit=unit, hertz=measure.hertz)


def in_words(value: Value) -> str:
    return "a pure number" if value.dimension == PURE else units.text(value.dimension)


def as_float(number: Real) -> Real:
    return number if isinstance(number, Scalar) else float(number)


def representable(number: Real, place: Place, *factors: Real) -> Real:
    """The number. Raises D067 where it overflows, or is 0 although none of its factors is."""
    if isinstance(number, Scalar):
        return number
    if not math.isfinite(number):
        raise too_large(place)
    if factors and number == 0.0 and all(not isinstance(factor, Scalar) and factor != 0.0 for factor in factors):
        raise Problem(
            error(
                "D067",
                "this number is too small: it would become 0",
                place,
                help="the smallest is 4.9e-324, in SI units; for nothing at all write 0",
            )
        )
    return number


def too_large(place: Place) -> Problem:
    return Problem(error("D067", "this number is too large: the largest is 1.8e308", place))
