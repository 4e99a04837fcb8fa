"""A quantity, or a list of them: SI numbers with their dimension, each knowing where it was written.

A number may be a recorded scalar, where a sweep varies what it depends on; then what comes of it is recorded too.

Each number that arithmetic of lists gives is that of the same arithmetic on single numbers, so it has the same bits,
and is recorded where it depends on a varied value.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import cast

from ic.grammar.syntax import Binary, Indexed, Name, Unit, spanned
from ic.text.lexer import COMMAND_LINE
from met import units
from met.diagnostic import Label, Place, Problem, error
from met.frozen import frozen
from met.messages import other_units
from met.trace import Real, Scalar, absolute, floor, where
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


def unit_of_plan(unit: Unit | None, dimension: Dimension | None = None) -> Unit | None:
    """The unit in which a plan may show a value: the deck's; None, for SI, where the deck declares a part of it, or it
    is not of this dimension, if one is given."""
    if unit is None or unit.declared or (dimension is not None and measure_of(unit).dimension != dimension):
        return None
    return unit


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


def as_whole(value: Value, what: str, least: int, most: int, most_in_words: str) -> int:
    """A pure number that no sweep varies as a whole number. what: its name in a message. Raises Problem D113 where it
    is none, or not from `least` to `most`."""
    number = value.number
    if (
        isinstance(number, Scalar)
        or value.dimension != PURE
        or not float(number).is_integer()
        or not least <= number <= most
    ):
        raise Problem(error("D113", f"{what} is a whole number from {least} to {most_in_words}", value.place))
    return int(number)


def ceiling(x: Real) -> Real:
    """The least whole number that is not less than x."""
    return 0.0 - floor(0.0 - x)


def nearest_whole(x: Real) -> Real:
    """The nearest whole number; halves go away from zero."""
    size = absolute(x)
    below = floor(size)
    nearest = where(size - below >= 0.5, below + 1.0, below)
    return where(x < 0.0, 0.0 - nearest, nearest)


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


COMPONENTS = ("x", "y", "z")

Arithmetic = Callable[[Binary, Value, Value], Value]


def no_single_number(what: str, listed: ValueList) -> Problem:
    """The error where a list stands in the place of one number. what: it is given, in words"""
    count = len(listed.items)
    help = "leave the brackets out" if count == 1 else f"write one number: these are {count}"
    if count > 1 and listed.place.file == COMMAND_LINE:
        help = f"`--set` takes one number, and these are {count}; `--vary`, in its place, runs each of them"
    return Problem(error("D071", f"{what} is one number, and this is a list", listed.place, help=help))


def list_arithmetic(
    node: Binary, left: Value | ValueList, right: Value | ValueList, of_numbers: Arithmetic
) -> ValueList:
    """The operator between lists, or a list and a number. Raises Problem D071 where that has no meaning."""
    operator, place = node.operator, spanned(left.place, right.place)
    if isinstance(left, ValueList) and isinstance(right, ValueList):
        if operator not in ("+", "-"):
            helps = "write what is meant number by number: `[a.x * b.x, a.y * b.y, a.z * b.z]`, or their sum"
            raise Problem(
                error("D071", f"`{operator}` of two lists", node.place, also=_labels(left, right), help=helps)
            )
        if len(left.items) != len(right.items):
            message = f"`{operator}` of {len(left.items)} numbers and {len(right.items)}"
            helps = "lists are added and subtracted number by number, so both have as many"
            raise Problem(error("D071", message, node.place, also=_labels(left, right), help=helps))
        pairs = zip(_numbers(left), _numbers(right), strict=True)
        return _list_of([of_numbers(node, a, b) for a, b in pairs], place)
    if isinstance(left, ValueList) and isinstance(right, Value) and operator in ("*", "/"):
        unit = left.unit if right.dimension == PURE else None
        return replace(_list_of([of_numbers(node, number, right) for number in _numbers(left)], place), unit=unit)
    if isinstance(left, Value) and isinstance(right, ValueList) and operator == "*":
        unit = right.unit if left.dimension == PURE else None
        return replace(_list_of([of_numbers(node, left, number) for number in _numbers(right)], place), unit=unit)
    message = f"`{operator}` of {_what(left)} and {_what(right)}"
    helps = "a list is multiplied with a number and divided by one; lists of as many numbers are added and subtracted"
    raise Problem(error("D071", message, node.place, also=_labels(left, right), help=helps))


def signed(operator: str, written: ValueList, place: Place) -> ValueList:
    """The list behind a sign: for `-` with each number negated, else as it is; its place is that of the sign."""
    if operator == "+":
        return replace(written, place=place)
    items = [replace(number, number=-number.number, decimal="") for number in _numbers(written)]
    return replace(_list_of(items, place), unit=written.unit)


def component(name: Name, vector: Value | ValueList) -> Value:
    """The component `v.x` of a vector. Raises Problem D071 where the value is not a list of three numbers."""
    head, axis = name.path
    if not isinstance(vector, ValueList) or len(vector.items) != len(COMPONENTS):
        has = "is one number" if isinstance(vector, Value) else f"has {len(vector.items)}"
        helps = "`.x`, `.y` and `.z` are of a list of three"
        raise Problem(error("D071", f"`{head.text}` {has}, and `.{axis.text}` is one of three", name.place, help=helps))
    return replace(_numbers(vector)[COMPONENTS.index(axis.text)], place=name.place)


def indexed(node: Indexed, written: Value | ValueList, index: Value) -> Value | ValueList:
    """The element `lengths[i]` of a list, the first of which has the index 0. Raises Problem D286."""
    name, number = node.name.text, index.number
    if not isinstance(written, ValueList):
        helps = f"write it without brackets, or a list: `let {name} = [..., ...];`"
        raise Problem(error("D286", f"`{name}` is one number, and no list", node.place, help=helps))
    if isinstance(number, Scalar):
        helps = "vary the values of the list, or a value of its own"
        raise Problem(error("D286", "which value of a list is taken cannot vary", index.place, help=helps))
    count = len(written.items)
    if index.dimension != PURE or number != int(number) or not 0 <= number < count:
        index_words = f"{number:g}" if index.dimension == PURE else f"a quantity in {units.text(index.dimension)}"
        helps = (
            f"`{name}` has {count} values, `{name}[0]` to `{name}[{count - 1}]`"
            if count != 1
            else (f"`{name}` has one value, `{name}[0]`")
        )
        raise Problem(error("D286", f"`{name}` has no value with the index {index_words}", index.place, help=helps))
    return replace(written.items[int(number)], place=node.place)


def _list_of(items: list[Value], place: Place) -> ValueList:
    """The list of computed numbers, each at the place of the whole, where its unit would be corrected."""
    bare = len(items) > 1 and all(item.bare for item in items)
    return ValueList(tuple(replace(item, place=place, bare=bare) for item in items), place)


def _numbers(written: ValueList) -> list[Value]:
    """The numbers of a list. Raises Problem D071 for a list in it."""
    numbers = [item for item in written.items if isinstance(item, Value)]
    inner = next((item for item in written.items if isinstance(item, ValueList)), None)
    if inner is not None:
        raise Problem(error("D071", "a list inside a list", inner.place))
    return numbers


def _what(value: Value | ValueList) -> str:
    return "a list" if isinstance(value, ValueList) else "a number"


def _labels(left: Value | ValueList, right: Value | ValueList) -> list[Label]:
    return [Label(side.place, _what(side)) for side in (left, right)]
