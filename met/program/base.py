"""The base at an instant: where it is and how it moves, prescribed by its courses or free (docs/physics.md, section 1).

A free base has six coordinates, integrated with those of the joints: its origin in world axes, and a turn theta since
the (sub)step began, whose orientation is kept as a unit quaternion q_0. Its rates are the origin's velocity in world
axes and the angular velocity w in base axes. At a stage

    q = q_0 o exp(theta),     d(theta)/dt = w + theta x w / 2 + b theta x (theta x w),
    b = (1 - phi/2 cot(phi/2))/phi^2,   phi = |theta|

which is exact (Hairer, Lubich and Wanner, Geometric Numerical Integration, 2006, IV.7), so every integrator keeps its
order on the rotations; a step ends by taking theta into the quaternion, which is made a unit one again. At its
beginning theta is 0, and its slope w: so semi-implicit Euler turns the base with the new rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from met.dynamics.kinematics import LinkMotion, link_motions
from met.dynamics.spatial import (
    HERE,
    ZERO,
    Pose,
    Real,
    Vector,
    add,
    cross,
    is_zero,
    rotation_quaternion,
    scale,
    settled,
    turn_vector,
    turn_vector_back,
)
from met.dynamics.tree import Tree
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan import BASE
from met.program import cells
from met.program.courses import TIME
from met.program.machine import PARAMETER, Machine, ReadCell
from met.trace import Scalar, Truth, cos, sin, sqrt, where
from met.trace.program import Tape
from met.vectors import Quaternion, composed, quaternion_rpy

TURNS = ("base:turn_x", "base:turn_y", "base:turn_z")
COORDINATES = ("base:x", "base:y", "base:z", *TURNS)
"""Of a free base; their cells are named as a joint's are: `base:x.q`, `base:x.qd`."""

ORIENTATION = tuple(f"base:orientation.{part}" for part in "wxyz")


@frozen
class Base:
    """The base at one stage.

    pose    R_WB, and p_WB, m
    w, v    angular velocity, and velocity of the origin, base axes, rad/s, m/s
    wd, a   their derivatives in the world, base axes, where the motion is prescribed; zero of a free base
    turned  d(theta)/dt of a free base, rad/s; zero of others
    """

    pose: Pose = HERE
    w: Vector = ZERO
    v: Vector = ZERO
    wd: Vector = ZERO
    a: Vector = ZERO
    turned: Vector = ZERO

    def to_base(self, vector: Vector) -> Vector:
        """Base components of a vector given in world axes."""
        return vector if self.pose is HERE else turn_vector_back(self.pose.R, vector)


def coordinates(machine: Machine) -> tuple[str, ...]:
    """All that is integrated as positions with rates: the joints' names, then `COORDINATES` of a free base."""
    return (*(joint.name for joint in machine.joints), *free(machine))


def free(machine: Machine) -> tuple[str, ...]:
    """The coordinates of a free base; none of another."""
    return COORDINATES if machine.structure.free else ()


def base_of(machine: Machine, read: ReadCell, y: Motion, time: Real) -> Base:
    """The base at a state and a time (s); of a free base y has the coordinates, theta included."""
    if machine.structure.base is None:
        return Base()
    return _free(read, y) if machine.structure.free else prescribed(machine, read, time)


def motions(tree: Tree, q: Sequence[Real], qd: Sequence[Real], base: Base) -> dict[str, LinkMotion]:
    """Every link in the world, by name; the base, where it is one, just where it is."""
    found = link_motions(tree, q, qd, base.pose, (base.w, base.v))
    return found | ({BASE: LinkMotion(base.pose, base.w, base.v)} if BASE in found else {})


def slopes_of_base(base: Base, solved: tuple[Vector, Vector], y: Motion) -> tuple[tuple[Real, ...], tuple[Real, ...]]:
    """Slopes of a free base's coordinates and of its rates, from its acceleration (angular, linear; base axes)."""
    wd, a = solved
    return (*y.qd[-6:-3], *base.turned), (*turn_vector(base.pose.R, a), *wd)


def prescribed(machine: Machine, read: ReadCell, time: Real) -> Base:
    """The base as its courses have it at a time (`courses`)."""
    varying = {path: read(PARAMETER + path) for path in machine.courses.inputs if path != TIME}
    numbers = machine.courses.replay({TIME: time, **varying})
    found = [settled(x) if isinstance(x, Scalar) else np.float64(x) for x in numbers]
    rows: list[Any] = [tuple(found[i : i + 3]) for i in range(0, len(found), 3)]
    pose = Pose((rows[0], rows[1], rows[2]), rows[3])
    return Base(pose, *(turn_vector_back(pose.R, row) for row in rows[4:]))


# A free base


def start(machine: Machine, tape: Tape) -> None:
    """The initial state of a free base: `rate` is given in world axes."""
    def given(name: str) -> Vector:
        x, y, z = (machine.value(f"initial.base.{name}.{axis}", tape.read) for axis in "xyz")
        return x, y, z

    turn = quaternion_rpy(*given("rpy"))
    _write(tape, True, turn)
    w = turn_vector_back(rotation_quaternion(*turn), given("rate"))
    for name, q, qd in zip(COORDINATES, (*given("position"), *ZERO), (*given("velocity"), *w), strict=True):
        tape.write(f"{name}.q", q)
        tape.write(f"{name}.qd", qd)


def begun(machine: Machine, y: Motion) -> Motion:
    """A state at which a (sub)step begins, or is seen: theta is 0 there."""
    return Motion((*y.q[:-3], 0.0, 0.0, 0.0), y.qd, y.x) if machine.structure.free else y


def orientation(machine: Machine, tape: Tape) -> tuple[Real, ...]:
    """The quaternion of a free base, at the beginning of the (sub)step; of another nothing."""
    return _read(tape.read, "") if machine.structure.free else ()


def keep_orientation(machine: Machine, tape: Tape, copy: str) -> None:
    """Keeps a copy of the orientation at which the (sub)step began."""
    if machine.structure.free:
        for name in ORIENTATION:
            tape.write(f"{copy}{name}", tape.read(name))


def turn(machine: Machine, tape: Tape, active: Truth, y: Motion, copy: str = "") -> None:
    """Takes the turn of a (sub)step that ends at y into the orientation, of which `copy` was its beginning."""
    if machine.structure.free:
        _write(tape, active, _turned(_read(tape.read, copy), y.q[-3:]))


def _free(read: ReadCell, y: Motion) -> Base:
    theta, v, w = y.q[-3:], y.qd[-6:-3], y.qd[-3:]
    there = _read(read, "")
    if not all(is_zero(part) for part in theta):
        there = _turned(there, theta)
    R = rotation_quaternion(*there)
    return Base(Pose(R, y.q[-6:-3]), w, turn_vector_back(R, v), turned=_slope(theta, w))  # type: ignore[arg-type]


def _slope(theta: tuple[Real, ...], w: tuple[Real, ...]) -> Vector:
    """d(theta)/dt: head of this file."""
    if all(is_zero(part) for part in theta):
        return w  # type: ignore[return-value]
    size, half, s = _half_turn(theta)
    b = where(size == 0.0, 1.0 / 12.0, (1.0 - half * cos(half) / s) / where(size == 0.0, 1.0, size))
    once = cross(theta, w)  # type: ignore[arg-type]
    return add(w, add(scale(0.5, once), scale(b, cross(theta, once))))  # type: ignore[arg-type]


def _turned(q: Quaternion, theta: tuple[Real, ...]) -> Quaternion:
    """q o exp(theta), of length 1."""
    size, half, s = _half_turn(theta)
    along = where(size == 0.0, 0.5, 0.5 * s / half)
    x, y, z = (along * part for part in theta)
    product = composed(q, (where(size == 0.0, 1.0, cos(half)), x, y, z))
    shrink = 1.0 / sqrt(sum((part * part for part in product[1:]), product[0] * product[0]))
    w, x, y, z = (shrink * part for part in product)
    return w, x, y, z


def _half_turn(theta: tuple[Real, ...]) -> tuple[Real, Real, Real]:
    """phi^2, phi/2 (1 where phi is 0, so that it may divide) and its sine."""
    x, y, z = theta
    size = x * x + y * y + z * z
    half = where(size == 0.0, 1.0, 0.5 * sqrt(size))
    return size, half, sin(half)


def _read(read: ReadCell, copy: str) -> Quaternion:
    w, x, y, z = (read(f"{copy}{name}") for name in ORIENTATION)
    return w, x, y, z


def _write(tape: Tape, active: Truth, q: Quaternion) -> None:
    for name, part in zip(ORIENTATION, q, strict=True):
        cells.keep(tape, active, name, part)
