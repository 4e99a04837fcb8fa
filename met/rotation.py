"""Unit quaternions (w, x, y, z): one turns a vector u as q u q* does. Over plain numbers, arrays and recorded ones."""

from __future__ import annotations

from met.trace import Real, cos, sin, sqrt, where

Vector = tuple[Real, Real, Real]
Matrix = tuple[Vector, Vector, Vector]
Quaternion = tuple[Real, Real, Real, Real]


def quaternion(R: Matrix) -> Quaternion:
    """The unit quaternion of a rotation, w >= 0.

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
