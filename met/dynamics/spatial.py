"""Spatial quantities as tuples of Reals, in the few operations that planar steps need; vectors are `met.vectors`'.

Everything here is plain arithmetic on `Real = float | Scalar`: no arrays, so that a trace sees every zero and one.

    Rigid      mass, h = mass * centre of mass, I about the origin as (xx, xy, xz, yy, yz, zz)
    Symmetric  a symmetric 6x6 in blocks [[A, B], [B', C]]: A, C as (xx, xy, xz, yy, yz, zz), B row by row

Spatial order is angular over linear. A general change of frame costs too much on a 6x6, so every change is a
chain of turns about one axis and shifts along one axis; the axes are 0, 1, 2 for x, y, z. "Raise" goes from a child
frame to its parent frame, "lower" from parent to child, where the child frame is the parent frame turned by
(c, s) = (cos, sin) about the axis, or shifted by d along it. A turn by a multiple of 90 degrees costs nothing.
"""

from __future__ import annotations

from typing import NamedTuple

from met.trace import Real, Scalar, Truth, sqrt, where
from met.vectors import (  # noqa: F401 - the whole room takes them from here
    IDENTITY,
    ZERO,
    Matrix,
    Turn,
    Vector,
    add,
    constant,
    cross,
    dot,
    product,
    rotation_about,
    rotation_quaternion,
    rotation_rpy,
    scale,
    snap_rotation,
    snapped,
    sub,
    transposed,
    turn_by,
    turn_vector,
    turn_vector_back,
)

Six = tuple[Real, Real, Real, Real, Real, Real]
Nine = tuple[Real, Real, Real, Real, Real, Real, Real, Real, Real]

NO_TURN: Turn = (1.0, 0.0)

# Place of entry (i, j) of a symmetric 3x3 among its six numbers.
AT = ((0, 1, 2), (1, 3, 4), (2, 4, 5))


class Pose(NamedTuple):
    """Frame B in frame A: R_AB and p_AB, the origin of B from that of A, in A's axes, m."""

    R: Matrix
    p: Vector


HERE = Pose(IDENTITY, ZERO)


class Rigid(NamedTuple):
    """Inertia of a rigid body in a frame: mass kg, h = mass * centre kg m, I about the frame's origin kg m^2."""

    mass: Real
    h: Vector
    I: Six  # noqa: E741


NO_INERTIA = Rigid(0.0, ZERO, (0.0,) * 6)


class Symmetric(NamedTuple):
    """A symmetric 6x6 matrix, angular over linear: A angular, C linear, B = angular rows by linear columns."""

    A: Six
    B: Nine
    C: Six

    def column(self, k: int) -> Six:
        """Column k of the 6x6."""
        if k < 3:
            row = AT[k]
            return (self.A[row[0]], self.A[row[1]], self.A[row[2]], self.B[3 * k], self.B[3 * k + 1], self.B[3 * k + 2])
        row = AT[k - 3]
        return (self.B[k - 3], self.B[k], self.B[k + 3], self.C[row[0]], self.C[row[1]], self.C[row[2]])


NOTHING = Symmetric((0.0,) * 6, (0.0,) * 9, (0.0,) * 6)


def settled(x: Real) -> Real:
    """x as a plain number where a trace has found that it is constant."""
    if isinstance(x, Scalar):
        known = x.graph.value(x.ref)
        return x if known is None else known
    return x


def all_constant(*groups: tuple[object, ...]) -> bool:
    """True where every number of these tuples (of tuples) is known when the tree is built."""
    return all(all_constant(x) if isinstance(x, tuple) else constant(x) for group in groups for x in group)


def is_zero(x: Real) -> bool:
    """True where x is known to be exactly zero when the tree is built."""
    return bool(constant(x) and x == 0.0)


def root(x: Real) -> Real:
    """The square root; constant if x is."""
    return float(sqrt(x)) if constant(x) else sqrt(x)


def choose(condition: Truth, a: Real, b: Real) -> Real:
    """a where the condition holds, else b; no selection is recorded where the condition is known."""
    if isinstance(condition, bool):
        return a if condition else b
    return where(condition, a, b)


def compose(outer: Pose, inner: Pose) -> Pose:
    """Pose of C in A from B in A and C in B."""
    return Pose(product(outer.R, inner.R), add(outer.p, turn_vector(outer.R, inner.p)))


def inverse(pose: Pose) -> Pose:
    """Pose of A in B from B in A."""
    p = turn_vector_back(pose.R, pose.p)
    return Pose(transposed(pose.R), (-p[0], -p[1], -p[2]))


# -- rigid inertia ---------------------------------------------------------------------------------------------------


def rigid_about_centre(mass: Real, com: Vector, inertia: Six) -> Rigid:
    """Rigid in the link frame from inertia about the centre of mass, (xx, yy, zz, xy, xz, yz) in link axes."""
    xx, yy, zz, xy, xz, yz = inertia
    return rigid_shift(Rigid(mass, ZERO, (xx, xy, xz, yy, yz, zz)), com)


def rigid_shift(body: Rigid, p: Vector) -> Rigid:
    """The same body in a frame of the same axes in which the old origin is at p."""
    m, h, I = body  # noqa: E741
    moved = add(h, scale(m, p))
    # I - h x p x - p x h' x with h' = h + m p, entry by entry.
    e = tuple(h[i] * p[i] + p[i] * moved[i] for i in range(3))
    return Rigid(
        m,
        moved,
        (
            I[0] + (e[1] + e[2]),
            I[1] - (h[0] * p[1] + p[0] * moved[1]),
            I[2] - (h[0] * p[2] + p[0] * moved[2]),
            I[3] + (e[0] + e[2]),
            I[4] - (h[1] * p[2] + p[1] * moved[2]),
            I[5] + (e[0] + e[1]),
        ),
    )


def rigid_turn(body: Rigid, R: Matrix) -> Rigid:
    """The same body in a frame of the same origin, R turning old components into new ones."""
    m, h, I = body  # noqa: E741
    full = ((I[0], I[1], I[2]), (I[1], I[3], I[4]), (I[2], I[4], I[5]))
    half = product(R, full)
    return Rigid(
        m,
        turn_vector(R, h),
        (
            dot(half[0], R[0]),
            dot(half[0], R[1]),
            dot(half[0], R[2]),
            dot(half[1], R[1]),
            dot(half[1], R[2]),
            dot(half[2], R[2]),
        ),
    )


def rigid_raise(body: Rigid, pose: Pose) -> Rigid:
    """The same body in the parent frame, its own frame having the given pose there."""
    return rigid_shift(rigid_turn(body, pose.R), pose.p)


def rigid_sum(a: Rigid, b: Rigid) -> Rigid:
    return Rigid(a.mass + b.mass, add(a.h, b.h), tuple(x + y for x, y in zip(a.I, b.I, strict=True)))  # type: ignore


def apply_symmetric(I: Six, w: Vector) -> Vector:  # noqa: E741
    """I w for a symmetric 3x3."""
    return (dot((I[0], I[1], I[2]), w), dot((I[1], I[3], I[4]), w), dot((I[2], I[4], I[5]), w))


def add_rigid(M: Symmetric, body: Rigid) -> Symmetric:
    """M plus the 6x6 of a rigid body, [[I, h x], [-h x, m]]."""
    (hx, hy, hz), m = body.h, body.mass
    B, C = M.B, M.C
    return Symmetric(
        tuple(x + y for x, y in zip(M.A, body.I, strict=True)),  # type: ignore[arg-type]
        (B[0], B[1] - hz, B[2] + hy, B[3] + hz, B[4], B[5] - hx, B[6] - hy, B[7] + hx, B[8]),
        (C[0] + m, C[1], C[2], C[3] + m, C[4], C[5] + m),
    )


def symmetric_sum(M: Symmetric, N: Symmetric) -> Symmetric:
    return Symmetric(*(tuple(x + y for x, y in zip(a, b, strict=True)) for a, b in zip(M, N, strict=True)))  # type: ignore


# -- planar turns and shifts along an axis ---------------------------------------------------------------------------


def _others(axis: int) -> tuple[int, int]:
    return ((1, 2), (2, 0), (0, 1))[axis]


def _quarter(turn: Turn) -> int | None:
    """The number of quarter turns in this turn, exactly; None where it is not whole."""
    c, s = turn
    if not (constant(c) and constant(s)):
        return None
    return {(1.0, 0.0): 0, (0.0, 1.0): 1, (-1.0, 0.0): 2, (0.0, -1.0): 3}.get((float(c), float(s)))


def raise_vector(axis: int, turn: Turn, a: Vector) -> Vector:
    """R a, R the turn about the axis: child components into parent components."""
    i, j = _others(axis)
    c, s = turn
    out = list(a)
    out[i] = c * a[i] - s * a[j]
    out[j] = s * a[i] + c * a[j]
    return (out[0], out[1], out[2])


def lower_vector(axis: int, turn: Turn, a: Vector) -> Vector:
    """R' a: parent components into child components."""
    return raise_vector(axis, (turn[0], -turn[1]), a)


def raise_turned(axis: int, turn: Turn, M: Symmetric) -> Symmetric:
    """diag(R, R) M diag(R, R)', the turn of a 6x6 from child into parent components."""
    quarter = _quarter(turn)
    if quarter == 0:
        return M
    return Symmetric(
        _turn_symmetric(axis, turn, quarter, M.A),
        _turn_general(axis, turn, quarter, M.B),
        _turn_symmetric(axis, turn, quarter, M.C),
    )


def _turn_symmetric(axis: int, turn: Turn, quarter: int | None, A: Six) -> Six:
    """R A R' of a symmetric 3x3, R the turn about the axis. quarter: the number of quarter turns; None: any other
    turn."""
    i, j = _others(axis)
    c, s = turn
    out = list(A)
    ii, jj, ij, ik, jk = AT[i][i], AT[j][j], AT[i][j], AT[i][axis], AT[j][axis]
    if quarter is None:
        # xx' - xx = -(s^2 (xx - yy) + 2 c s xy), and the same bracket gives xy': five products in all.
        w = s * (A[ii] - A[jj]) + (c + c) * A[ij]
        out[ii] = A[ii] - s * w
        out[jj] = A[jj] + s * w
        out[ij] = c * w - A[ij]
    elif quarter != 2:
        out[ii], out[jj], out[ij] = A[jj], A[ii], -A[ij]
    out[ik] = c * A[ik] - s * A[jk]
    out[jk] = s * A[ik] + c * A[jk]
    return tuple(out)  # type: ignore[return-value]


def _turn_general(axis: int, turn: Turn, quarter: int | None, B: Nine) -> Nine:
    """R B R' of any 3x3, R the turn about the axis. quarter: the number of quarter turns; None: any other turn."""
    i, j = _others(axis)
    k = axis
    c, s = turn
    out = list(B)
    ii, jj, ij, ji = 4 * i, 4 * j, 3 * i + j, 3 * j + i
    if quarter is None:
        w = s * (B[ii] - B[jj]) + c * (B[ij] + B[ji])
        out[ii] = B[ii] - s * w
        out[jj] = B[jj] + s * w
        out[ij] = c * w - B[ji]
        out[ji] = c * w - B[ij]
    elif quarter != 2:
        out[ii], out[jj], out[ij], out[ji] = B[jj], B[ii], -B[ji], -B[ij]
    for a, b in ((3 * i + k, 3 * j + k), (3 * k + i, 3 * k + j)):
        out[a] = c * B[a] - s * B[b]
        out[b] = s * B[a] + c * B[b]
    return tuple(out)  # type: ignore[return-value]


def raise_shifted(axis: int, d: Real, M: Symmetric) -> Symmetric:
    """A 6x6 inertia about the child's origin, taken about the parent's; the child's origin is at d along the axis."""
    if is_zero(d):
        return M
    x = axis
    y, z = _others(axis)
    A, B, C = list(M.A), list(M.B), M.C
    old = M.B
    for k in range(3):
        B[3 * y + k] = old[3 * y + k] - d * C[AT[z][k]]
        B[3 * z + k] = old[3 * z + k] + d * C[AT[y][k]]
    A[AT[x][y]] = A[AT[x][y]] - d * old[3 * x + z]
    A[AT[x][z]] = A[AT[x][z]] + d * old[3 * x + y]
    A[AT[y][y]] = A[AT[y][y]] - d * (old[3 * y + z] + B[3 * y + z])
    A[AT[z][z]] = A[AT[z][z]] + d * (old[3 * z + y] + B[3 * z + y])
    A[AT[y][z]] = A[AT[y][z]] + d * (old[4 * y] - B[4 * z])
    return Symmetric(tuple(A), tuple(B), C)  # type: ignore[arg-type]


def shift_force(axis: int, d: Real, moment: Vector, force: Vector) -> Vector:
    """Moment about the parent's origin of a wrench given about the child's, which is at d along the axis."""
    if is_zero(d):
        return moment
    y, z = _others(axis)
    out = list(moment)
    out[y] = moment[y] - d * force[z]
    out[z] = moment[z] + d * force[y]
    return (out[0], out[1], out[2])


def shift_motion(axis: int, d: Real, angular: Vector, linear: Vector) -> Vector:
    """linear + angular x d, the linear part at a child's origin at d along the axis."""
    if is_zero(d):
        return linear
    y, z = _others(axis)
    out = list(linear)
    out[y] = linear[y] + d * angular[z]
    out[z] = linear[z] - d * angular[y]
    return (out[0], out[1], out[2])


def swapped(M: Symmetric) -> Symmetric:
    """The 6x6 with linear over angular."""
    B = M.B
    return Symmetric(M.C, (B[0], B[3], B[6], B[1], B[4], B[7], B[2], B[5], B[8]), M.A)
