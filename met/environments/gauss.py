"""Gauss's rule with Legendre's polynomials: the points and weights that integrate polynomials exactly up to 2 n - 1."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from functools import cache

DIGITS = 40  # far more than a double has, so that the doubles are the nearest ones, and the same on every machine


@cache
def gauss(count: int) -> tuple[tuple[float, float], ...]:
    """Points in (-1, 1), rising, and their weights, which sum to 2 (Abramowitz and Stegun 25.4.29)."""
    points = []
    with localcontext() as context:
        context.prec = DIGITS
        for i in reversed(range(count)):
            x = Decimal(math.cos(math.pi * (i + 0.75) / (count + 0.5)))
            for _ in range(6):  # Newton from four digits: each doubles them
                value, slope = _legendre(count, x)
                x -= value / slope
            slope = _legendre(count, x)[1]
            points.append((float(x), float(2 / ((1 - x * x) * slope * slope))))
    return tuple(points)


def _legendre(count: int, x: Decimal) -> tuple[Decimal, Decimal]:
    """P_n(x) and its slope."""
    before, value = Decimal(1), x
    for k in range(2, count + 1):
        before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
    return value, count * (x * value - before) / (x * x - 1)
