"""Arms as their sources have them, in Pinocchio: each built from its source's own numbers, in its source's own manner.

Nothing here comes from met, ic or a deck. SI units, angles in rad. Where a source's inertia is no body's, or where it
has no centre of mass, what the deck says it takes in its place is here too, and marked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tests.oracles.package import Package

pin = Package("pinocchio")

Array = np.ndarray
X, Y, Z = np.eye(3)
HALF = np.pi / 2.0
FOOT, INCH, SLUG, POUND = 0.3048, 0.0254, 14.593902937, 0.45359237  # in m and kg


@dataclass(frozen=True)
class Part:
    """A joint and the link it carries: its pose and axis in the parent, mass, centre of mass, xx yy zz xy xz yz."""

    at: Sequence[float]
    R: Array
    axis: Array
    mass: float
    com: Sequence[float]
    inertia: Sequence[float]


def tensor(inertia: Sequence[float]) -> Array:
    xx, yy, zz, xy, xz, yz = (*inertia, 0.0, 0.0, 0.0)[:6]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def lacks(inertia: Sequence[float]) -> float:
    """By how much the largest principal moment exceeds the sum of the others, kg m^2: no body's where positive."""
    least, middle, most = np.linalg.eigvalsh(tensor(inertia))
    return float(most - middle - least)


def model(parts: Sequence[Part], gravity: Sequence[float] = (0.0, 0.0, 0.0), held: int = 0) -> pin.Model:
    """The parts as a chain of revolute joints; the first `held` parts are fixed to the ground."""
    made = pin.Model()
    made.gravity.linear = np.array(gravity)
    joint, tail = 0, pin.SE3.Identity()
    for i, part in enumerate(parts):
        place = tail * pin.SE3(part.R, np.array(part.at, float))
        if i < held:
            tail = place
            continue
        joint = made.addJoint(joint, pin.JointModelRevoluteUnaligned(part.axis), place, f"{i}")
        tail = pin.SE3.Identity()
        body = pin.Inertia(part.mass, np.array(part.com, float), tensor(part.inertia))
        made.appendBodyToJoint(joint, body, pin.SE3.Identity())
    return made


def fixed_on(made: pin.Model, mass: float, com: Sequence[float], every_way: float = 0.0) -> pin.Model:
    """One more body on the last link: its inertia is the same about each axis, none for a point mass."""
    body = pin.Inertia(mass, np.array(com), every_way * np.eye(3))
    made.appendBodyToJoint(made.njoints - 1, body, pin.SE3.Identity())
    return made


def turn(axis: Array, angle: float) -> Array:
    return Rotation.from_rotvec(axis * angle).as_matrix()


# --- Nguyen and Hughes 1994, as in github.com/vyas-shubham/TraceableRobotModels, SRMS_Canadarm.urdf: for each body the
# origin of its joint (m), axis, mass (kg), inertia (kg m^2). Not the file's: the wrist's z (it has -0.1524); the centre
# of mass, assumed half way to the next joint; the inertia is the file's, taken about it.
# fmt: off
_SHUTTLE = (
    ((0.0, 0.0, 0.0),       Z, 63.24,  (3.664, 3.803, 0.686, 0.0044, 0.0047, 0.506)),
    ((0.0, 0.0, -0.5172),   Z, 32.12,  (1.115, 1.417, 0.595, -0.019, -0.08, -0.037)),
    ((0.0, 0.0, -0.3048),   Y, 139.35, (3.225, 998.63, 997.18, -1.928, 9.185, -0.0302)),
    ((6.377, 0.0, -0.1524), Y, 87.42,  (1.59, 632.9, 632.51, 0.8021, -3.786, -0.08)),
    ((7.06, 0.0, 0.1524),   Y, 8.48,   (0.0893, 0.402, 0.402)),
    ((0.4572, 0.0, 0.0),    Z, 45.94,  (0.408, 4.68, 4.68)),
    ((0.762, 0.0, 0.0),     X, 45.21,  (1.903, 3.816, 2.823, 0.385, 0.966, 0.353)),
)
SHUTTLE_TIP = (0.6604, 0.0, 0.0)
SHUTTLE_EFFORT = np.array([1570.0, 1570.0, 1074.0, 470.0, 470.0, 470.0])  # N m
SHUTTLE_RATE = np.array([0.03997, 0.03997, 0.0560, 0.0831, 0.0831, 0.0831])  # rad/s

# The same, SSRMS_Canadarm2.urdf
_STATION = (
    ((0.0, 0.0, 0.0),     X, 243.66, (9.336, 44.413, 44.413)),
    ((1.3589, 0.0, 0.0),  X, 105.98, (12.19, 12.13, 3.061)),
    ((0.0, 0.0, 0.7026),  Z, 105.98, (8.088, 3.061, 8.446)),
    ((0.0, -0.5692, 0.0), Y, 314.88, (15.41, 2094.71, 2103.19, 49.52)),
    ((7.11, -0.475, 0.0), Y, 279.2,  (9.522, 1966.28, 1966.28, -39.95)),
    ((7.11, 0.0, 0.0),    Y, 105.98, (8.305, 3.061, 8.0386)),
    ((0.0, -0.5692, 0.0), Z, 105.98, (12.13, 12.13, 3.061)),
    ((0.0, 0.0, -0.7026), X, 243.66, (9.336, 44.41, 44.41)),
)
STATION_TIP = (1.3589, 0.0, 0.0)
STATION_EFFORT, STATION_RATE = 2332.0, 0.0698132


def _half_way(rows: Sequence[tuple], tip: Sequence[float], first: Array) -> tuple[Part, ...]:
    ends = [*(row[0] for row in rows[1:]), tip]
    turns = [first, *[np.eye(3)] * (len(rows) - 1)]
    return tuple(Part(at, R, axis, mass, np.array(end) / 2.0, inertia)
                 for (at, axis, mass, inertia), end, R in zip(rows, ends, turns, strict=True))


SHUTTLE = _half_way(_SHUTTLE, SHUTTLE_TIP, turn(X, np.pi))
STATION = _half_way(_STATION, STATION_TIP, turn(Y, -HALF))

# --- D. Dimitrov, github.com/drdv/bmsd, models/model_ETS7.m: for each joint t (from the centre of mass of the link
# before it to the joint), f (from the joint to the centre of mass of its own link), the turn about x, then about the
# new y, then about the new z; then the link's mass and inertia. Every joint turns about its z.
_ETS_VII = (
    ((-0.785, -0.295, 1.0), (0.0, 0.0, 0.175), (0.0, 0.0, 0.0), 35.01,
     (1.218, 0.5132, 1.692, -0.07309, 0.00071, 0.1132)),
    ((0.0, 0.275, 0.175), (0.435, 0.0, 0.0), (-HALF, 0.0, -HALF), 22.45,
     (0.102, 3.378, 3.752, 0.0, -0.00214, 0.0)),
    ((0.435, 0.0, 0.0), (0.315, 0.0, 0.275), (0.0, 0.0, HALF), 21.89,
     (0.4327, 2.266, 2.528, 0.0, -0.6328, 0.0)),
    ((0.315, 0.0, 0.0), (0.0, 0.0, -0.1335), (0.0, 0.0, -HALF), 16.54,
     (0.3878, 0.3963, 0.07271, 0.0, 0.01675, 0.0)),
    ((0.0, 0.0, -0.1335), (0.0, 0.0, 0.1385), (HALF, HALF, 0.0), 26.0,
     (0.5727, 0.5987, 0.1290, 0.0, -0.2313, 0.0)),
    ((0.0, 0.0, 0.1385), (0.0, 0.0, 0.266), (np.pi, HALF, 0.0), 18.49,
     (0.165, 0.241, 0.2590, 0.000781, -0.0145, -0.000137)),
)
ETS_VII_PUBLISHED = tuple(row[4] for row in _ETS_VII)
ETS_VII_HAND = (0.0, 0.0, 0.532)
ETS_VII_SATELLITE = (2552.0, (6206.0, 3541.0, 7087.0, 48.16, 78.52, -29.22))
# What the deck has in their place: link, which of the six, value
ETS_VII_MENDED = ((1, 1, 3.651), (2, 4, -0.43), (4, 4, -0.20))


def _ets_vii() -> tuple[Part, ...]:
    made, before = [], np.zeros(3)
    for i, (t, f, (x, y, z), mass, inertia) in enumerate(_ETS_VII):
        six = list(inertia)
        for link, which, value in ETS_VII_MENDED:
            if link == i:
                six[which] = value
        made.append(Part(before + t, turn(X, x) @ turn(Y, y) @ turn(Z, z), Z, mass, f, six))
        before = np.array(f)
    return tuple(made)


ETS_VII = _ets_vii()

# --- Manutec r3. ModelicaAdditions, MultiBody.Examples.Robots.r3 (Otter 2000), and the Modelica Standard Library,
# RobotR3.Utilities.MechanicalStructure: for each joint its axis, its link's r (from this joint to the next), mass,
# centre of mass, inertia about it. The world's y is up. Of link 1 the sources have yy alone.
_R3 = (
    (Y, (0.0, 0.0, 0.0),  1.0,  (0.0, 0.0, 0.0),       (1.16, 1.16, 1.16)),
    (X, (0.0, 0.5, 0.0),  56.5, (0.172, 0.205, 0.0),   (2.58, 0.64, 2.73, -0.46)),
    (X, (0.0, 0.0, 0.0),  26.4, (0.064, -0.034, 0.0),  (0.279, 0.245, 0.413, -0.070)),
    (Y, (0.0, 0.73, 0.0), 28.7, (0.0, 0.32, 0.0),      (1.67, 0.081, 1.67)),
    (X, (0.0, 0.0, 0.0),  5.2,  (0.0, 0.023, 0.0),     (1.25, 0.81, 1.53)),
    (Y, (0.0, 0.0, 0.0),  0.0,  (0.0, 0.0, 0.0),       (0.0, 0.0, 0.0)),
)
_R3_LIBRARY = (
    (Y, (0.0, 0.324, 0.3),    1.0,  (0.0, 0.0, 0.0),      (1.16, 1.16, 1.16)),
    (X, (0.0, 0.65, 0.0),     56.5, (0.172, 0.205, 0.0),  (2.58, 0.64, 2.73, -0.46)),
    (X, (0.0, 0.414, -0.155), 26.4, (0.064, -0.034, 0.0), (0.279, 0.245, 0.413, -0.070)),
    (Y, (0.0, 0.186, 0.0),    28.7, (0.0, 0.0, 0.0),      (1.67, 0.081, 1.67)),
    (X, (0.0, 0.125, 0.0),    5.2,  (0.0, 0.0, 0.0),      (1.25, 0.81, 1.53)),
    (Y, (0.0, 0.0, 0.0),      0.5,  (0.05, 0.05, 0.05),   (1e-3, 1e-3, 1e-3)),  # not given: the library's default
)
# fmt: on
R3_LOAD = (15.0, (0.1, 0.25, 0.1))
R3_LIBRARY_LOAD = (*R3_LOAD, 1e-3)
"""The library's default inertia, for its example gives none."""
R3_ROTORS = np.array([105.0, 210.0, 60.0, 99.0, 79.2, 99.0]) ** 2 * np.array(
    [1.3e-3, 1.3e-3, 1.3e-3, 1.6e-4, 1.8e-4, 4.3e-5]
)


def _r3(rows: Sequence[tuple], foot: float) -> tuple[Part, ...]:
    """The library's y, up, is the world's z."""
    places = [(0.0, 0.0, foot), *(row[1] for row in rows[:-1])]
    turns = [turn(X, HALF), *[np.eye(3)] * 5]
    return tuple(
        Part(at, R, axis, mass, com, inertia)
        for at, R, (axis, _, mass, com, inertia) in zip(places, turns, rows, strict=True)
    )


R3, R3_LIBRARY = _r3(_R3, 0.0), _r3(_R3_LIBRARY, 0.351)
