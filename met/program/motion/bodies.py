"""Freely moving bodies: their coordinates, and their orientation from step to step (docs/physics.md, section 1).

A free base is one, and each payload that flies for a time. Each has six coordinates, integrated with those of the
joints: its origin in world axes, and a turn theta since the (sub)step began, whose orientation is kept as a unit
quaternion q_0. Its rates are the origin's velocity in world axes and the angular velocity w in its own axes. At a stage

    q = q_0 o exp(theta),     d(theta)/dt = w + theta x w / 2 + b theta x (theta x w),
    b = (1 - phi/2 cot(phi/2))/phi^2,   phi = |theta|

which is exact (Hairer, Lubich and Wanner, Geometric Numerical Integration, 2006, IV.7), so every integrator keeps its
order on the rotations; a step ends by taking theta into the quaternion, which is made a unit one again. At its
beginning theta is 0, and its slope w: so semi-implicit Euler turns the body with the new rate.
"""

from __future__ import annotations

from met.dynamics.spatial import (
    Pose,
    Real,
    Vector,
    add,
    cross,
    is_zero,
    rotation_quaternion,
    scale,
    turn_vector,
    turn_vector_back,
)
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan import BASE
from met.program import cell_names, cells
from met.program.system import ReadCell, System
from met.trace import Truth, cos, sin, sqrt, where
from met.trace.program import Tape
from met.vectors import Quaternion, composed

PAYLOAD = "payload:"
"""Prefix of the cells of a payload."""

SIX = 6


@frozen
class FreeBody:
    """A body that moves freely.

    name   before its coordinates, `base:x`, whose cells are named as a joint's are: `base:x.q`, `base:x.qd`
    first  number of its first coordinate among all (`coordinates`)
    """

    name: str
    first: int

    @property
    def coordinates(self) -> tuple[str, ...]:
        return tuple(f"{self.name}:{part}" for part in ("x", "y", "z", "turn_x", "turn_y", "turn_z"))

    @property
    def orientation(self) -> tuple[str, ...]:
        """The cells of the body's quaternion."""
        return tuple(cell_names.BODY_ORIENTATION(self.name, part) for part in "wxyz")

    def q(self, y: Motion) -> tuple[Real, ...]:
        return y.q[self.first : self.first + SIX]

    def qd(self, y: Motion) -> tuple[Real, ...]:
        return y.qd[self.first : self.first + SIX]

    def qdd(self, slopes: tuple[Real, ...]) -> tuple[Real, ...]:
        """The body's accelerations, among the slopes of all rates."""
        return slopes[self.first : self.first + SIX]


@frozen
class Flight:
    """A freely moving body at a stage.

    pose    R_WB and p_WB, m
    w, v    angular velocity, and velocity of the origin, its own axes, rad/s, m/s
    turned  d(theta)/dt, rad/s
    """

    pose: Pose
    w: Vector
    v: Vector
    turned: Vector


def bodies(system: System) -> tuple[FreeBody, ...]:
    """The base, where it is free, then the payloads that fly for a time."""
    names = ([BASE] if system.structure.free else []) + [PAYLOAD + payload.name for payload in system.flying]
    joints = len(system.joints)
    return tuple(FreeBody(name, joints + SIX * number) for number, name in enumerate(names))


def coordinates(system: System) -> tuple[str, ...]:
    """The names of everything integrated as positions with rates: joints, then bodies' coordinates."""
    of_bodies = (name for body in bodies(system) for name in body.coordinates)
    return (*(joint.name for joint in system.joints), *of_bodies)


def flight(body: FreeBody, read: ReadCell, y: Motion) -> Flight:
    """Pose and velocities of a body at a state with its coordinates, theta included."""
    q, qd = body.q(y), body.qd(y)
    theta, v, w = q[3:], qd[:3], qd[3:]
    quaternion = _read(body, read, "")
    if not all(is_zero(part) for part in theta):
        quaternion = _turned(quaternion, theta)
    R = rotation_quaternion(*quaternion)
    return Flight(Pose(R, q[:3]), w, turn_vector_back(R, v), _slope(theta, w))  # type: ignore[arg-type]


def slopes(
    body: FreeBody, y: Motion, *, pose: Pose, turned: Vector, solved: tuple[Vector, Vector]
) -> tuple[tuple[Real, ...], tuple[Real, ...]]:
    """Slopes of a body's coordinates and of its rates, from its flight and its acceleration (angular, linear; its own
    axes)."""
    wd, a = solved
    return (*body.qd(y)[:3], *turned), (*turn_vector(pose.R, a), *wd)


def place(body: FreeBody, tape: Tape, active: Truth, turn: Quaternion, position: Vector, v: Vector, w: Vector) -> None:
    """Set a body's state where active: velocity in world axes, angular velocity in its own."""
    _write(body, tape, active, turn)
    for name, q, qd in zip(body.coordinates, (*position, 0.0, 0.0, 0.0), (*v, *w), strict=True):
        cells.keep(tape, active, f"{name}.q", q)
        cells.keep(tape, active, f"{name}.qd", qd)


def with_zero_turn(system: System, y: Motion) -> Motion:
    """A state at the start of a (sub)step, or as seen by computers: theta is 0 there."""
    q = list(y.q)
    for body in bodies(system):
        q[body.first + 3 : body.first + SIX] = (0.0, 0.0, 0.0)
    return Motion(tuple(q), y.qd, y.x)


def orientation(system: System, tape: Tape) -> tuple[Real, ...]:
    """The quaternions of all bodies, at the beginning of the (sub)step."""
    return tuple(part for body in bodies(system) for part in _read(body, tape.read, ""))


def keep_orientation(system: System, tape: Tape, copy: str) -> None:
    """Keep a copy of the orientations at the start of the (sub)step."""
    for body in bodies(system):
        for name in body.orientation:
            tape.write(f"{copy}{name}", tape.read(name))


def turn(system: System, tape: Tape, active: Truth, y: Motion, copy: str = "") -> None:
    """Add the turns of a (sub)step that ends at y to the orientations, which began as `copy`."""
    for body in bodies(system):
        _write(body, tape, active, _turned(_read(body, tape.read, copy), body.q(y)[3:]))


def turn_by(body: FreeBody, tape: Tape, theta: tuple[Real, ...]) -> None:
    """Turn a body by this rotation vector in its own axes, rad."""
    _write(body, tape, True, _turned(_read(body, tape.read, ""), theta))


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


def _read(body: FreeBody, read: ReadCell, copy: str) -> Quaternion:
    w, x, y, z = (read(f"{copy}{name}") for name in body.orientation)
    return w, x, y, z


def _write(body: FreeBody, tape: Tape, active: Truth, q: Quaternion) -> None:
    for name, part in zip(body.orientation, q, strict=True):
        cells.keep(tape, active, name, part)
