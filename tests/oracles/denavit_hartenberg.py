"""Arms by Denavit-Hartenberg tables, from textbooks: products of matrices in numpy, and models of Pinocchio.

Nothing here comes from met, ic or a deck. A row is (a, alpha, d, theta) in m and rad. A revolute joint ("R") adds its q
to theta, a prismatic one ("P") to d.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.oracles.package import Package

pin = Package("pinocchio")

Array = np.ndarray
Row = tuple[float, float, float, float]
Body = tuple[float, Sequence[float], Sequence[float]]  # mass, centre of mass in the link frame, xx yy zz about it

QUARTER = np.pi / 2.0

# Corke and Armstrong-Helouvry 1994, as in the Robotics Toolbox for Python, models/DH/Puma560.py
PUMA_CLASSIC: tuple[Row, ...] = (
    (0.0, QUARTER, 0.672, 0.0), (0.4318, 0.0, 0.0, 0.0), (0.0203, -QUARTER, 0.15005, 0.0),
    (0.0, QUARTER, 0.4318, 0.0), (0.0, -QUARTER, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0),
)  # fmt: skip
PUMA_BODIES: tuple[Body, ...] = (
    (10.0, (0.0, 0.0, 0.0), (0.35, 0.35, 0.35)), (17.4, (-0.3638, 0.006, 0.2275), (0.13, 0.524, 0.539)),
    (4.8, (-0.0203, -0.0141, 0.07), (0.066, 0.0785, 0.0125)), (0.82, (0.0, 0.019, 0.0), (1.8e-3, 1.3e-3, 1.8e-3)),
    (0.34, (0.0, 0.0, 0.0), (0.3e-3, 0.4e-3, 0.3e-3)), (0.09, (0.0, 0.0, 0.032), (0.15e-3, 0.15e-3, 0.04e-3)),
)  # fmt: skip

# Craig, Introduction to Robotics, ch. 3: the Puma 560 in his convention, with a2, a3, d3, d4 of the arm above
PUMA_OF_CRAIGS_BOOK: tuple[Row, ...] = (
    (0.0, 0.0, 0.0, 0.0), (0.0, -QUARTER, 0.0, 0.0), (0.4318, 0.0, 0.15005, 0.0),
    (0.0203, -QUARTER, 0.4318, 0.0), (0.0, QUARTER, 0.0, 0.0), (0.0, -QUARTER, 0.0, 0.0),
)  # fmt: skip

# Stanford arm: memo AIM-177 and Paul 1981, as in the Robotics Toolbox for Python, models/DH/Stanford.py
STANFORD: tuple[Row, ...] = (
    (0.0, -QUARTER, 0.412, 0.0), (0.0, QUARTER, 0.154, 0.0), (0.0203, 0.0, 0.0, -QUARTER),
    (0.0, -QUARTER, 0.0, 0.0), (0.0, QUARTER, 0.0, 0.0), (0.0, 0.0, 0.263, 0.0),
)  # fmt: skip
STANFORD_KINDS = "RRPRRR"


def shifted(rows: Sequence[Row]) -> tuple[Row, ...]:
    """A classic table as one of Craig's, with a row more for what is left behind the last joint.

    The product of Rz Tz Tx Rx over the rows is bracketed anew: each row takes the length and twist of the one before.
    """
    before = [(0.0, 0.0), *((a, alpha) for a, alpha, _, _ in rows)]
    after = [*((d, theta) for _, _, d, theta in rows), (0.0, 0.0)]
    return tuple((a, alpha, d, theta) for (a, alpha), (d, theta) in zip(before, after, strict=True))


def moved(row: Row, kind: str, q: float) -> Row:
    a, alpha, d, theta = row
    return (a, alpha, d, theta + q) if kind == "R" else (a, alpha, d + q, theta)


def link(convention: str, row: Row) -> Array:
    """The 4x4 of a row: the link's frame in its parent's."""
    a, alpha, d, theta = row
    z, x = _turned(2, theta) @ _shifted(2, d), _turned(0, alpha) @ _shifted(0, a)
    return z @ x if convention == "classic" else x @ z


def poses(convention: str, rows: Sequence[Row], kinds: str, q: Sequence[float]) -> list[Array]:
    """4x4 of every link's frame in the world."""
    at, found = np.eye(4), []
    for row, kind, x in zip(rows, kinds, q, strict=True):
        at = at @ link(convention, moved(row, kind, x))
        found.append(at)
    return found


def model(
    convention: str, rows: Sequence[Row], kinds: str, bodies: Sequence[Body], gravity: float = -9.81
) -> pin.Model:
    """The arm in Pinocchio, its joints about or along z where the convention has them; gravity along the world's z."""
    made = pin.Model()
    made.gravity.linear = np.array([0.0, 0.0, gravity])
    parent, tail = 0, np.eye(4)
    for i, (row, kind, (mass, com, moments)) in enumerate(zip(rows, kinds, bodies, strict=True)):
        a, alpha, d, theta = row
        z, x = _turned(2, theta) @ _shifted(2, d), _turned(0, alpha) @ _shifted(0, a)
        place, tail = (tail @ z, x) if convention == "classic" else (x @ z, np.eye(4))
        joint = pin.JointModelRZ() if kind == "R" else pin.JointModelPZ()
        parent = made.addJoint(parent, joint, pin.SE3(place), f"joint{i}")
        made.appendBodyToJoint(parent, pin.Inertia(mass, np.array(com), np.diag(moments)), pin.SE3(tail))
    return made


def _turned(axis: int, angle: float) -> Array:
    one, two = [(1, 2), (2, 0), (0, 1)][axis]
    made = np.eye(4)
    made[one, one] = made[two, two] = np.cos(angle)
    made[two, one] = np.sin(angle)
    made[one, two] = -made[two, one]
    return made


def _shifted(axis: int, by: float) -> Array:
    made = np.eye(4)
    made[axis, 3] = by
    return made
