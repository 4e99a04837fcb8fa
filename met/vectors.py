"""Three-vectors and rotations in space as tuples of Reals.

Plain arithmetic on `Real = float | Scalar`: no arrays, so that a trace sees every zero and one.

    Vector     (x, y, z)
    Matrix     three rows; R_AB turns components in B into components in A
    Quaternion (w, x, y, z), of unit length: it turns a vector u as q u q* does
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeGuard

from met.trace import Real, atan2, cos, sin, sqrt, where

Vector = tuple[Real, Real, Real]
Matrix = tuple[Vector, Vector, Vector]
Turn = tuple[Real, Real]
Quaternion = tuple[Real, Real, Real, Real]

ZERO: Vector = (0.0, 0.0, 0.0)
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def constant(x: object) -> TypeGuard[float]:
    """True where x is known when the tree is built: a plain Python number.

    A Scalar is not, nor is numpy's float64, which stands for a case's value where the plain run must take exactly
    the same path as the traced one.
    """
    return type(x) in (float, int)


def add(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(k: Real, a: Vector) -> Vector:
    return (k * a[0], k * a[1], k * a[2])


def dot(a: Sequence[Real], b: Sequence[Real]) -> Real:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def turn_vector(R: Matrix, a: Vector) -> Vector:
    """R a: components in the outer frame of a vector given in the inner one."""
    return (dot(R[0], a), dot(R[1], a), dot(R[2], a))


def transposed(R: Matrix) -> Matrix:
    return ((R[0][0], R[1][0], R[2][0]), (R[0][1], R[1][1], R[2][1]), (R[0][2], R[1][2], R[2][2]))


def turn_vector_back(R: Matrix, a: Vector) -> Vector:
    """R' a: components in the inner frame of a vector given in the outer one."""
    return turn_vector(transposed(R), a)


def product(P: Matrix, Q: Matrix) -> Matrix:
    columns = transposed(Q)
    rows = [(dot(row, columns[0]), dot(row, columns[1]), dot(row, columns[2])) for row in P]
    return (rows[0], rows[1], rows[2])


def turn_by(angle: Real) -> Turn:
    """(cos, sin) of an angle; constants of a constant, where the trace's functions give numpy's numbers."""
    return (float(cos(angle)), float(sin(angle))) if constant(angle) else (cos(angle), sin(angle))


def snapped(x: float, scale: float = 1.0) -> float:
    """x with rounding noise near 0 and +-scale removed, so that right angles fold: cos(pi/2) is 0, not 6e-17."""
    tolerance = 2e-15 * scale
    if abs(x) < tolerance:
        return 0.0
    if abs(abs(x) - scale) < tolerance:
        return scale if x > 0.0 else -scale
    return x


def snap_rotation(R: Matrix) -> Matrix:
    """R with its constant entries freed of rounding noise; others are unchanged."""
    rows = [tuple(snapped(float(x)) if constant(x) else x for x in row) for row in R]
    return (rows[0], rows[1], rows[2])  # type: ignore[return-value]


def rotation_rpy(roll: Real, pitch: Real, yaw: Real) -> Matrix:
    """R = Rz(yaw) Ry(pitch) Rx(roll): turns about the fixed x, y, z axes in that order; rad."""
    (cr, sr), (cp, sp), (cy, sy) = ((_turn(angle)) for angle in (roll, pitch, yaw))
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def rotation_about(axis: Vector, angle: Real) -> Matrix:
    """Rodrigues' rotation by angle (rad) about a unit axis."""
    c, s = _turn(angle)
    x, y, z = axis
    k = 1.0 - c
    return (
        (c + x * x * k, x * y * k - z * s, x * z * k + y * s),
        (x * y * k + z * s, c + y * y * k, y * z * k - x * s),
        (x * z * k - y * s, y * z * k + x * s, c + z * z * k),
    )


def rotation_quaternion(w: Real, x: Real, y: Real, z: Real) -> Matrix:
    """Rotation of a unit quaternion, scalar part first."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def quaternion(R: Matrix) -> Quaternion:
    """The unit quaternion (w, x, y, z) of a rotation, w >= 0: R turns a vector u as q u q* does.

    Of 4 q q' every entry is a sum of entries of R; the row with the largest diagonal entry, which is at least 1, is
    divided by its root (Shepperd, "Quaternion from rotation matrix", 1978), so nothing is lost near any rotation.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R
    rows = (
        (1.0 + xx + yy + zz, zy - yz, xz - zx, yx - xy),
        (zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx),
        (xz - zx, xy + yx, 1.0 - xx + yy - zz, yz + zy),
        (yx - xy, xz + zx, yz + zy, 1.0 - xx - yy + zz),
    )
    best, size = rows[0], rows[0][0]
    for k, row in enumerate(rows[1:], 1):
        more = row[k] > size
        best = tuple(where(more, new, old) for new, old in zip(row, best, strict=True))
        size = where(more, row[k], size)
    scale = where(best[0] < 0.0, -0.5, 0.5) / sqrt(size)
    w, x, y, z = (scale * part for part in best)
    return w, x, y, z


def quaternion_rpy(roll: Real, pitch: Real, yaw: Real) -> Quaternion:
    """The unit quaternion of turns about the fixed x, y, z axes in that order, rad: Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, sr), (cp, sp), (cy, sy) = ((cos(0.5 * angle), sin(0.5 * angle)) for angle in (roll, pitch, yaw))
    return (
        cy * cp * cr + sy * sp * sr,
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
    )


def composed(a: Quaternion, b: Quaternion) -> Quaternion:
    """a o b: first the turn b, then a."""
    w, x, y, z = a
    c, i, j, k = b
    return (
        w * c - (x * i + y * j + z * k),
        w * i + x * c + (y * k - z * j),
        w * j + y * c + (z * i - x * k),
        w * k + z * c + (x * j - y * i),
    )


def rotation_vector(R: Matrix) -> Vector:
    """Axis times angle of a rotation, its angle from 0 to pi: the logarithm of R, rad.

    By the quaternion, whose angle is 2 atan2(|v|, w): to some roundings everywhere from 0 to pi. At half a turn either
    axis is right, and one is taken.
    """
    w, x, y, z = quaternion(R)
    size = sqrt(x * x + y * y + z * z)
    small = size < 1e-150  # its square underflows: the angle is then 2 |v|, as it is to rounding below 1e-8
    ratio = where(small, 2.0, 2.0 * atan2(size, w) / where(small, 1.0, size))
    return scale(ratio, (x, y, z))


def _turn(angle: Real) -> Turn:
    c, s = turn_by(angle)
    return (snapped(c), snapped(s)) if constant(c) and constant(s) else (c, s)
