"""A base that moves freely: its part in the recursion, and the six equations of its motion.

    IA_0 [wd; a] = -pA_0        IA_0, pA_0 as of any link (`recursion`); a is less gravity

IA_0 is symmetric and positive definite, so it is taken apart without pivoting, IA_0 = L diag(d) L'. The linear half
goes first: its pivots are masses, those of the angular half then inertias about the centre of mass.
"""

from __future__ import annotations

from typing import NamedTuple

from met.dynamics.spatial import AT, Real, Rigid, Symmetric, Vector
from met.frozen import frozen
from met.trace import Truth, any_of
from met.trace.primitives import divide
from met.trace.scalar import Scalar

ORDER = (3, 4, 5, 0, 1, 2)
"""Components of a six-vector, angular over linear, in the order of elimination."""


@frozen
class Floating:
    """The base as a body, in the recursion's base frame.

    body     inertia of all links that are fixed to the base, its own included
    dynamic  the same with what the joints on it do not see of theirs (`TreeJoint.dynamic`)
    mass, reach   of all that hangs together at q = 0: kg, and the trace of its inertia about the frame's origin,
             kg m^2; 0.0 where cases vary it
    """

    body: Rigid
    dynamic: Rigid
    mass: float = 0.0
    reach: float = 0.0


class Factors(NamedTuple):
    """L (rows below the diagonal) and 1/d of a 6x6, in the order of elimination."""

    L: tuple[tuple[Real, ...], ...]
    Dinv: tuple[Real, ...]


def factors(M: Symmetric, limits: tuple[float, float]) -> tuple[Factors, Truth]:
    """L diag(d) L' of a 6x6, and whether a d is not above its limit: (linear, angular), kg and kg m^2."""
    L: list[tuple[Real, ...]] = []
    d: list[Real] = []
    Dinv: list[Real] = []
    for i in range(6):
        row: list[Real] = []
        scaled: list[Real] = []  # L_ij d_j
        for j in range(i):
            below = _entry(M, ORDER[i], ORDER[j])
            for k in range(j):
                below = below - scaled[k] * L[j][k]
            scaled.append(below)
            row.append(below * Dinv[j])
        pivot = _entry(M, ORDER[i], ORDER[i])
        for low, high in zip(row, scaled, strict=True):
            pivot = pivot - low * high
        L.append(tuple(row))
        d.append(pivot)
        Dinv.append(1.0 / pivot if isinstance(pivot, Scalar) else divide(1.0, pivot))
    return Factors(tuple(L), tuple(Dinv)), any_of(d[i] <= limits[i // 3] for i in range(6))


def accelerated(LDL: Factors, moment: Vector, force: Vector) -> tuple[Vector, Vector]:
    """Angular and linear acceleration under a wrench about the frame's origin."""
    wrench = (*moment, *force)
    x: list[Real] = []
    for i in range(6):
        value = wrench[ORDER[i]]
        for j in range(i):
            value = value - LDL.L[i][j] * x[j]
        x.append(value)
    x = [value * inverse for value, inverse in zip(x, LDL.Dinv, strict=True)]
    for i in reversed(range(6)):
        for j in range(i + 1, 6):
            x[i] = x[i] - LDL.L[j][i] * x[j]
    return (x[3], x[4], x[5]), (x[0], x[1], x[2])


def mobility(LDL: Factors) -> Symmetric:
    """IA_0^-1: the accelerations under unit wrenches, angular over linear."""
    columns = []
    for k in range(6):
        unit = [1.0 if i == k else 0.0 for i in range(6)]
        angular, linear = accelerated(LDL, (unit[0], unit[1], unit[2]), (unit[3], unit[4], unit[5]))
        columns.append((*angular, *linear))
    upper = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    return Symmetric(
        tuple(columns[j][i] for i, j in upper),  # type: ignore[arg-type]
        tuple(columns[j][i] for i in range(3) for j in range(3, 6)),  # type: ignore[arg-type]
        tuple(columns[j + 3][i + 3] for i, j in upper),  # type: ignore[arg-type]
    )


def _entry(M: Symmetric, i: int, j: int) -> Real:
    """The entry (i, j) of a symmetric 6x6 in blocks."""
    i, j = min(i, j), max(i, j)
    if j < 3:
        return M.A[AT[i][j]]
    return M.B[3 * i + j - 3] if i < 3 else M.C[AT[i - 3][j - 3]]
