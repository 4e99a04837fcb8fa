"""Sums, products, roots and random numbers whose bits are the same on every machine.

Additions, multiplications, divisions and square roots are rounded alike everywhere; libraries add in an order that
depends on the processor, and their logarithms, exponentials and eigenvalues differ in the last places. A search that
branches on such a place would run other cases.
"""

from __future__ import annotations

import math
import zlib

import numpy as np

KEPT = 2.0**30
"""Inverse of the step to which logarithms are rounded: libraries differ only far below it."""


def added(values: np.ndarray) -> np.ndarray:
    """The sum along the first axis, added in order."""
    return np.asarray(np.add.accumulate(values, axis=0)[-1])


def total(values: np.ndarray) -> float:
    """The sum of a vector, added in order."""
    return float(added(values))


def transformed(matrix: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The matrix times each row, [row, dimension], added in order."""
    out = np.zeros_like(rows)
    for column in range(rows.shape[1]):
        out += rows[:, column, None] * matrix[None, :, column]
    return out


def lower_factor(matrix: np.ndarray) -> np.ndarray | None:
    """Lower triangular A with A A' equal to a symmetric matrix, by Cholesky; None: it is not positive definite."""
    left = np.array(matrix)
    out = np.zeros_like(left)
    for i in range(len(left)):
        pivot = float(left[i, i])
        if not 0.0 < pivot < math.inf:
            return None
        column = left[i:, i] / math.sqrt(pivot)
        out[i:, i] = column
        left[i:, i:] -= column[:, None] * column[None, :]
    return out


def growth(x: float) -> float:
    """A factor near e^x for x in [-1, 1], by one division; that of -x is its inverse, as with e^x."""
    return (2.0 + x) / (2.0 - x)


def power(base: float, exponent: int) -> float:
    """A base in [0, 1] raised to a whole power by multiplications; 0 for results that are negligible."""
    out = 1.0
    for _ in range(exponent):
        out *= base
        if out < 1e-30:
            return 0.0
    return out


def logarithm(x: float) -> float:
    """The natural logarithm, rounded to 30 binary places."""
    return round(math.log(x) * KEPT) / KEPT


SUMMED = 12
"""Number of uniform numbers in a nearly normal one: the variance of their sum is 1."""


class Draws:
    """A stream of random numbers that follows from a seed and a name, by Philox, a counter-based generator."""

    def __init__(self, seed: int, name: str) -> None:
        self._generator = np.random.Generator(np.random.Philox(key=[seed, zlib.crc32(name.encode())]))

    def even(self, *shape: int) -> np.ndarray:
        """Numbers that are uniform in [0, 1)."""
        return self._generator.random(shape)

    def nearly_normal(self, *shape: int) -> np.ndarray:
        """Numbers of mean 0 and variance 1: sums of twelve uniform ones less 6, so that no logarithm is needed; all lie
        between -6 and 6."""
        return added(self.even(SUMMED, *shape)) - SUMMED / 2

    def whole(self, below: int, *shape: int) -> np.ndarray:
        """Whole numbers in [0, below)."""
        return (self.even(*shape) * below).astype(np.int64)

    def spread(self, count: int, dimension: int) -> np.ndarray:
        """Points of the unit cube, [count, dimension], as a Latin hypercube: each coordinate has one in each of `count`
        equal intervals."""
        out = np.empty((count, dimension))
        for column in range(dimension):
            out[:, column] = (np.argsort(self.even(count), kind="stable") + self.even(count)) / max(count, 1)
        return out
