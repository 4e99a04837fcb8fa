"""Damped least squares, unrolled: rates that fulfil a task as closely as possible, and stay small near singularities.

    u = J' (J J' + lambda^2 I)^-1 v       makes |J u - v|^2 + lambda^2 |u|^2 least

(Nakamura and Hanafusa, Inverse kinematic solutions with singularity robustness, J. Dyn. Sys. Meas. Control 108, 1986.)
J J' is symmetric and not negative, so it is taken apart without pivoting, L diag(d) L'. Without damping u is the
pseudo-inverse's, the smallest of all that carry the task out.
"""

from __future__ import annotations

from collections.abc import Sequence

from met.trace import Real, Scalar, maximum, sqrt, where
from met.trace.primitives import divide
from met.vectors import dot

Rows = list[list[Real]]

RESOLVED = 1e-12
"""Share of the trace of J J' below which the square of a singular value cannot be told from zero: four digits above
rounding."""


def gram(rows: Sequence[Sequence[Real]]) -> Rows:
    """J J' of the rows of J."""
    matrix: Rows = [[0.0] * len(rows) for _ in rows]
    for i, row in enumerate(rows):
        for j in range(i + 1):
            matrix[i][j] = matrix[j][i] = dot(row, rows[j])
    return matrix


def damped(rows: Sequence[Sequence[Real]], square: Rows, damping: Real, task: Sequence[Real]) -> list[Real]:
    """u for the rows of J, its J J', lambda^2 and v."""
    y = _solved(_factors(square, damping), task)
    return [dot([row[k] for row in rows], y) for k in range(len(rows[0]))]


def least_singular_value(square: Rows) -> Real:
    """The smallest singular value of J, from J J': never more than it is, and at most 7 % less.

    The largest eigenvalue b of B = (J J')^-1 from traces, b^4 <= m + s sqrt(n - 1) with m and s the mean and deviation
    of the eigenvalues of B^4 (Wolkowicz and Styan, Bounds for eigenvalues using traces, Lin. Alg. Appl. 29, 1980): no
    iteration, and exact where one singular value is much smaller than the others. A value below 1e-6 of the largest
    may come out as 0.
    """
    n = len(square)
    trace: Real = sum((square[i][i] for i in range(n)), 0.0)
    size = where(trace > 0.0, trace, 1.0)
    factors = _factors([[entry / size for entry in row] for row in square], RESOLVED)
    columns = [_solved(factors, [1.0 if i == k else 0.0 for i in range(n)]) for k in range(n)]
    fourth = gram(gram(columns))
    mean = sum((fourth[i][i] for i in range(n)), 0.0) * (1.0 / n)
    spread = maximum(sum((dot(row, row) for row in fourth), 0.0) * (1.0 / n) - mean * mean, 0.0)
    largest = sqrt(sqrt(mean + sqrt(float(n - 1) * spread)))
    return sqrt(size * maximum(1.0 / largest - RESOLVED, 0.0))


def _factors(square: Rows, more: Real) -> tuple[Rows, list[Real]]:
    """L (rows below the diagonal) and 1/d of the matrix with `more` added to its diagonal."""
    L: Rows = []
    inverse: list[Real] = []
    for i, entries in enumerate(square):
        row: list[Real] = []
        scaled: list[Real] = []  # L_ij d_j
        for j in range(i):
            below = entries[j]
            for k in range(j):
                below = below - scaled[k] * L[j][k]
            scaled.append(below)
            row.append(below * inverse[j])
        pivot = entries[i] + more
        for low, high in zip(row, scaled, strict=True):
            pivot = pivot - low * high
        L.append(row)
        inverse.append(1.0 / pivot if isinstance(pivot, Scalar) else divide(1.0, pivot))
    return L, inverse


def _solved(factors: tuple[Rows, list[Real]], right: Sequence[Real]) -> list[Real]:
    L, inverse = factors
    x: list[Real] = []
    for i, value in enumerate(right):
        for j in range(i):
            value = value - L[i][j] * x[j]
        x.append(value)
    x = [value * part for value, part in zip(x, inverse, strict=True)]
    for i in reversed(range(len(x))):
        for j in range(i + 1, len(x)):
            x[i] = x[i] - L[j][i] * x[j]
    return x
