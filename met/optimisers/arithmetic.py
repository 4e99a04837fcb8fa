"""Sums, products and roots whose bits are the same on every machine.

Additions, multiplications, divisions and square roots are rounded alike everywhere; libraries add in an order that
depends on the processor, and their logarithms, exponentials and eigenvalues differ in the last places. A search that
branches on such a place would run other cases.
"""

from __future__ import annotations

import math

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
