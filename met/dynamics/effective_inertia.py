"""The effective inertia of a joint: the rest of the arm, reduced to an inertia and a torque (docs/physics.md, section
1).

One outward sweep serves all joints. Y_i is the mobility of link i, everything outboard of it cut away and all joints in
their modes: a six by six from wrench to acceleration.
"""

from __future__ import annotations

from met.dynamics.floating import mobility as base_mobility
from met.dynamics.recursion import Solved
from met.dynamics.spatial import (
    AT,
    NOTHING,
    Real,
    Symmetric,
    apply_symmetric,
    choose,
    dot,
    turn_vector,
    turn_vector_back,
)
from met.dynamics.tree import Tree
from met.trace.primitives import divide
from met.trace.scalar import Scalar


def effective_inertia(tree: Tree, solved: Solved) -> tuple[tuple[Real, Real], ...]:
    """(J_eff, b) at every joint, with tau_load_i = J_eff qdd_i + b and all other joints keeping their modes.

    Joint i's own rotor is in neither, the rotors of all other torque-mode joints are in both. It does not depend on
    joint i's own mode. Not S'IA S (the paper's eq. 7): what is inboard yields too, unless it is held. A free base
    yields; one that is fixed or prescribed does not.

    J_eff  kg m^2 (prismatic: kg)      b  N m (prismatic: N)
    """
    n = len(tree.joints)
    root = NOTHING if solved.base is None else base_mobility(solved.base)
    mobility = [NOTHING] * n
    result: list[tuple[Real, Real]] = [(0.0, 0.0)] * n
    for i in tree.order:
        joint, k = tree.joints[i], tree.joints[i].axis
        outer = root if joint.parent < 0 else mobility[joint.parent]
        Yp = solved.steps[i].lower_mobility(outer)
        U, D0, D, Dinv, rotor = solved.U[i], solved.D0[i], solved.D[i], solved.Dinv[i], solved.rotor[i]
        B, (angular, linear) = Yp.B, (U[:3], U[3:])
        rows = (B[0:3], B[3:6], B[6:9])
        halves = (
            apply_symmetric(Yp.A, angular),
            turn_vector(rows, linear),
            turn_vector_back(rows, angular),
            apply_symmetric(Yp.C, linear),
        )
        t = (*(x + y for x, y in zip(*halves[:2], strict=True)), *(x + y for x, y in zip(*halves[2:], strict=True)))
        s = dot(U, t)
        # 1/(1/D + s/D^2) - rotor over one denominator: the rotor may outweigh the arm a hundred times.
        yielding = _quotient(D * D0 - rotor * s, D + s) if solved.mode[i] is not False else 0.0
        J = choose(solved.mode[i], yielding, D0 - s)
        result[i] = (J, solved.tau_load[i] - J * solved.qdd[i])
        mobility[i] = _with_joint(Yp, k, t, s, Dinv)
    return tuple(result)


def _with_joint(Yp: Symmetric, k: int, t: tuple[Real, ...], s: Real, Dinv: Real) -> Symmetric:
    """P Yp P' + S S' Dinv, P = 1 - S U' Dinv: only row and column k differ from Yp."""
    A, B, C = list(Yp.A), list(Yp.B), list(Yp.C)
    own = ((t[k] * Dinv) * 2.0 - Dinv * (s * Dinv)) - Dinv
    for j in range(6):
        less = own if j == k else t[j] * Dinv
        row, column = min(j, k), max(j, k)
        if column < 3:
            A[AT[row][column]] = A[AT[row][column]] - less
        elif row < 3:
            B[3 * row + column - 3] = B[3 * row + column - 3] - less
        else:
            C[AT[row - 3][column - 3]] = C[AT[row - 3][column - 3]] - less
    return Symmetric(tuple(A), tuple(B), tuple(C))  # type: ignore[arg-type]


def _quotient(a: Real, b: Real) -> Real:
    return a / b if isinstance(a, Scalar) or isinstance(b, Scalar) else divide(a, b)
