"""Whole numbers near a number, plain or recorded; `met.trace.floor` is the first of them."""

from __future__ import annotations

from met.trace import Real, absolute, floor, where


def ceiling(x: Real) -> Real:
    """The least whole number that is not less than x."""
    return 0.0 - floor(0.0 - x)


def nearest_whole(x: Real) -> Real:
    """The nearest whole number; halves go away from zero."""
    size = absolute(x)
    below = floor(size)
    nearest = where(size - below >= 0.5, below + 1.0, below)
    return where(x < 0.0, 0.0 - nearest, nearest)
