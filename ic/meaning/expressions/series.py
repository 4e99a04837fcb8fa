"""Rows of numbers between two ends, each the double nearest to the exact result from the decimals as written."""

from __future__ import annotations

import math
from collections.abc import Iterable

from met.frozen import frozen
from met.units import fraction

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
