"""The motion in which all torques on the substituted joints balance, friction that sticks included.

    (diag(N^2 (J_m + c)) + Lambda) qdd = N (net - s F_c) - b_0

net is the motor's torque less viscous friction, plus the observer's unknown torque; s is the direction of sliding, 0
where a joint is stuck, whose qdd is then 0. c = (Kt^2/R + F_v) T/2 makes qdd the mean over a tick of T: back-EMF and
viscous friction grow while the shaft gains speed. The joints are solved together: one by one, the loop that runs
through the arm would have a gain above one from three joints on.
"""

from __future__ import annotations

from collections.abc import Sequence

from met.frozen import frozen
from met.trace import Real, Truth, absolute, both, clip, sign, where


@frozen
class JointSide:
    """One substituted joint's side of the balance.

    ratio    N;  inertia: N^2 (J_m + c), kg m^2 (kg)
    net      torque on the shaft before dry friction, N m;  dry: level of dry friction, N m
    w        rate of the shaft, rad/s;  band: below it, the joint counts as at rest
    """

    ratio: Real
    inertia: Real
    net: Real
    dry: Real
    w: Real
    band: Real


@frozen
class Balanced:
    """One joint's motion: its qdd, the friction in it (N m at the shaft), the direction of sliding s, and net."""

    qdd: Real
    friction: Real
    s: Real
    net: Real


Matrix = Sequence[Sequence[Real]]


def balanced(sides: Sequence[JointSide], Lambda: Matrix, b_0: Sequence[Real]) -> list[Balanced]:
    """The motion of all joints. Lambda, b_0: tau_load = Lambda qdd + b_0, joint side.

    A joint at rest begins stuck; in the passes that follow, all joints that friction does not hold break away at once,
    and one that would turn back on its own friction is stuck again.
    """
    m = len(sides)
    rest = [absolute(side.w) <= side.band for side in sides]
    s = [where(r, 0.0, sign(side.w)) for r, side in zip(rest, sides, strict=True)]
    qdd = solved(sides, Lambda, b_0, s)
    for _ in range(max(3, 2 * m)):
        s = [
            where(r, _decided(side, old, a, load), old)
            for r, side, old, a, load in zip(rest, sides, s, qdd, loads(Lambda, b_0, qdd), strict=True)
        ]
        qdd = solved(sides, Lambda, b_0, s)
    held = loads(Lambda, b_0, qdd)
    return [
        Balanced(
            a, where(way == 0.0, clip(side.net - load / side.ratio, -side.dry, side.dry), way * side.dry), way, side.net
        )
        for side, a, way, load in zip(sides, qdd, s, held, strict=True)
    ]


def bare(sides: Sequence[JointSide], Lambda: Matrix, b_0: Sequence[Real]) -> list[Balanced]:
    """The motion of all joints without friction, as in eq. 10 of the paper."""
    qdd = solved(sides, Lambda, b_0, [1.0] * len(sides), dry=False)
    return [Balanced(a, 0.0, 1.0, side.net) for side, a in zip(sides, qdd, strict=True)]


def _decided(side: JointSide, s: Real, qdd: Real, load: Real) -> Real:
    """The direction of sliding of a joint after one pass: it breaks away, sticks, or stays as it is."""
    need = side.net - load / side.ratio
    breaks_away = both(s == 0.0, absolute(need) > side.dry)
    turned_back = both(s != 0.0, s * qdd < 0.0)
    return where(breaks_away, sign(need), where(turned_back, 0.0, s))


def loads(Lambda: Matrix, b_0: Sequence[Real], qdd: Sequence[Real]) -> list[Real]:
    """Lambda qdd + b_0."""
    return [sum((x * a for x, a in zip(row, qdd, strict=True)), b) for row, b in zip(Lambda, b_0, strict=True)]


def solved(
    sides: Sequence[JointSide], Lambda: Matrix, b_0: Sequence[Real], s: Sequence[Real], *, dry: bool = True
) -> list[Real]:
    """qdd for these directions of sliding, exactly 0 where s is 0: elimination in order, since the matrix is
    definite."""
    m = len(sides)
    slides: list[Truth] = [way != 0.0 for way in s]
    rows = [
        [
            where(
                both(slides[i], slides[j]), Lambda[i][j] + (sides[i].inertia if i == j else 0.0), 1.0 if i == j else 0.0
            )
            for j in range(m)
        ]
        for i in range(m)
    ]
    right = [
        where(slides[i], side.ratio * (side.net - (s[i] * side.dry if dry else 0.0)) - b_0[i], 0.0)
        for i, side in enumerate(sides)
    ]
    for k in range(m):
        for i in range(k + 1, m):
            share = rows[i][k] / rows[k][k]
            rows[i] = [rows[i][j] - share * rows[k][j] if j > k else 0.0 for j in range(m)]
            right[i] = right[i] - share * right[k]
    qdd: list[Real] = [0.0] * m
    for i in reversed(range(m)):
        rest = sum((rows[i][j] * qdd[j] for j in range(i + 1, m)), 0.0)
        qdd[i] = where(slides[i], (right[i] - rest) / rows[i][i], 0.0)
    return qdd
