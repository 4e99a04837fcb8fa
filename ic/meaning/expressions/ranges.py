"""Rows of values in short notation: `first .. last by step`, linspace and logspace."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import cast

from ic.grammar.syntax import Call, Range, place_of
from ic.meaning.expressions.quantity import Value, ValueList, in_words, measure_of
from met import units
from met.diagnostic import Label, Problem, error
from met.frozen import frozen
from met.trace import Scalar
from met.units import PURE, Measure, fraction

DIGITS = 50
"""Digits of the points of one ratio before they are rounded: the errors of 100,000 of them stay far below a double's
last bit."""


@frozen
class Steps:
    """Equal steps from one number towards another, as fractions over `below`. meet: whether they reach it exactly."""

    first: int
    by: int
    below: int
    count: int
    meet: bool

    @classmethod
    def between(cls, a: float, b: float, step: float) -> Steps:
        """The steps from a to b; the step is not zero, and has the right sign. 0 to 1 by 0.1 includes 0.3."""
        fractions = [_shortest(x) for x in (a, b, step)]
        below = math.prod(under for _, under in fractions)
        first, last, by = (top * (below // under) for top, under in fractions)
        count, left = divmod(abs(last - first), abs(by))
        return cls(first, by, below, count + 1, not left)

    @property
    def last(self) -> float:
        return (self.first + (self.count - 1) * self.by) / self.below

    @property
    def points(self) -> list[float]:
        return [(self.first + i * self.by) / self.below for i in range(self.count)]


def even(a: float, b: float, n: int) -> Iterable[float]:
    """Points that are each the double nearest to the result from the ends' shortest decimals: 0.01 to 0.04 in 7
    includes 0.015."""
    (first, under_first), (last, under_last) = _shortest(a), _shortest(b)
    below = under_first * under_last
    p, q = first * under_last, last * under_first
    try:
        return [(p * (n - 1 - i) + q * i) / (below * (n - 1)) for i in range(n)]
    except OverflowError:
        return [a + (b - a) * (i / (n - 1)) for i in range(n)]


def _shortest(x: float) -> tuple[int, int]:
    """The shortest decimal that reads back as x, as a fraction. (Not a `Fraction`, whose import takes 2 ms.)"""
    return fraction(repr(x))


def by_ratio(a: float, b: float, n: int) -> Iterable[float]:
    """Points with one ratio, each the double nearest to the result from the ends' shortest decimals: 0.025 to 0.1 in 3
    includes 0.05. The ends have one sign."""
    from decimal import Context, Decimal

    exact = Context(prec=DIGITS)
    first, last = Decimal(repr(abs(a))), Decimal(repr(abs(b)))
    ratio = exact.power(exact.divide(last, first), exact.divide(Decimal(1), Decimal(n - 1)))
    inner, point = [], first
    for _ in range(n - 2):
        point = exact.multiply(point, ratio)
        inner.append(math.copysign(float(point), a))
    return [a, *inner, b]


MOST_POINTS = 100_000


def range_of(expression: Range, first: Value, last: Value, step: Value) -> ValueList:
    """The numbers of a range `first .. last by step`: steps from the first, as far as the last."""
    place = place_of(expression)
    for other in (last, step):
        if not units.same(first.dimension, other.dimension):
            raise Problem(
                error(
                    "D063",
                    f"a range from {in_words(first)} to {in_words(last)} by {in_words(step)}",
                    expression.place,
                    also=[Label(end.place, in_words(end)) for end in (first, last, step)],
                    help="all three must be of one dimension",
                )
            )
    if any(isinstance(value.number, Scalar) for value in (first, last, step)):
        raise Problem(
            error(
                "D121",
                "the values of a sweep depend on what the sweep varies",
                place,
                help="write numbers that stand still",
            )
        )
    a, b, by = (float(value.number) for value in (first, last, step))
    if (turning := _turning(step)) is not None:
        scale = turning.scale
        low, high, stride = (float(turning.decimal(x)) for x in (a, b, by))
        between = list(_steps(low, high, stride, expression, first, scale))[1:-1]
        points: Iterable[float] = (a, *(turning.to_si(x) for x in between), *((b,) if low != high else ()))
    else:
        points = _steps(a, b, by, expression, first)
    bare = first.bare and last.bare and step.bare
    values = (Value(x, first.dimension, place, bare, first.unit, hertz=first.hertz) for x in points)
    return ValueList(tuple(values), place, first.unit)


def _turning(value: Value) -> Measure | None:
    """The unit of a value where it is a multiple of pi, so that the value is a decimal in it alone; else None."""
    measure = measure_of(value.unit) if value.unit is not None else units.ONE
    return measure if measure.turns and measure.dimension == value.dimension else None


def _steps(a: float, b: float, step: float, expression: Range, first: Value, scale: float = 1.0) -> Iterable[float]:
    """The points of a range. scale: SI units in one of the numbers' unit"""

    def written(number: float) -> str:
        """The number in the unit of the first value, where that has one of its own."""
        number *= scale
        if first.unit is None or measure_of(first.unit).dimension != first.dimension:
            return f"{number:g}"
        return f"{number / measure_of(first.unit).scale:g} {first.unit.text}"

    if step == 0.0:
        raise Problem(error("D072", "a range by steps of zero has no end", place_of(expression.step)))
    if (b - a) * step < 0.0:
        raise Problem(
            error(
                "D072",
                f"steps of {written(step)} do not lead from {written(a)} to {written(b)}",
                place_of(expression.step),
                help="give the step the other sign, or change the ends about",
            )
        )
    steps = Steps.between(a, b, step)
    if steps.count > MOST_POINTS:
        raise Problem(
            error(
                "D072",
                f"a range of {min(steps.count, 10**300):.3g} values",
                place_of(expression),
                help=f"up to {MOST_POINTS} are possible",
            )
        )
    if not steps.meet:
        raise Problem(
            error(
                "D220",
                f"the steps do not meet the end: they reach {written(steps.last)}, and {written(b)} "
                "is not a whole number of steps from the first",
                place_of(expression.last),
                help="end where the steps do, or `linspace(from, to, count)`, whose ends are met",
            )
        )
    return steps.points


def spaced(call: Call, start: Value, end: Value, count: Value) -> ValueList:
    """Points from `from` to `to`, both included: evenly (of the decimal numbers as written), or by one ratio."""
    name = call.name.text
    if count.dimension != PURE or isinstance(count.number, Scalar) or not float(count.number).is_integer():
        raise Problem(
            error(
                "D072",
                f"the count of a {name} is a whole number",
                count.place,
                help=f"write `{name}(from, to, count) unit`",
            )
        )
    n = int(count.number)
    if not 2 <= n <= MOST_POINTS:
        raise Problem(error("D072", f"a {name} of {n} points", count.place, help=f"2 to {MOST_POINTS} are possible"))
    if not units.same(start.dimension, end.dimension):
        raise Problem(
            error(
                "D063",
                f"a {name} from {in_words(start)} to {in_words(end)}",
                end.place,
                help="both must be of one dimension",
            )
        )
    if isinstance(start.number, Scalar) or isinstance(end.number, Scalar):
        raise Problem(
            error(
                "D121",
                "the values of a sweep depend on what the sweep varies",
                call.place,
                help="write numbers that stand still",
            )
        )
    a, b = float(start.number), float(end.number)
    if name == "logspace" and not a * b > 0.0:
        raise Problem(
            error(
                "D072",
                "the ends of a logspace are both above or both below zero",
                call.place,
                help=[*_not_exponents(start, end, n), "linspace(...) has no such limit"],
            )
        )
    made_by = even if name == "linspace" else by_ratio
    if (turning := _turning(start)) is not None:
        low, high = (float(turning.decimal(x)) for x in (a, b))
        inner = list(made_by(low, high, n))[1:-1]
        points: Iterable[float] = (a, *(turning.to_si(x) for x in inner), b)
    else:
        points = made_by(a, b, n)
    bare = start.bare and end.bare
    values = (Value(x, start.dimension, call.place, bare, start.unit, hertz=start.hertz) for x in points)
    return ValueList(tuple(values), call.place, start.unit)


def _not_exponents(start: Value, end: Value, count: int) -> list[str]:
    """The remedy where the ends of a logspace look like exponents."""
    ends = [float(cast(float, value.number)) for value in (start, end)]
    if not (start.bare and end.bare) or any(not x.is_integer() or abs(x) > 300 for x in ends):
        return []
    powers = ", ".join(f"{10.0**x:g}" for x in ends)
    return [f"it takes the ends themselves, not their exponents: `logspace({powers}, {count})`"]
