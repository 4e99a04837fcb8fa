"""Freely moving bodies: their coordinates, and their orientation from step to step (docs/physics.md, section 1).

A free base is one, and each payload that flies for a time. Each has six coordinates, integrated with those of the
joints: its origin in world axes, and a turn theta since the (sub)step began, whose orientation is kept as a unit
quaternion q_0. Its rates are the origin's velocity in world axes and the angular velocity w in its own axes. At a stage

    q = q_0 o exp(theta),     d(theta)/dt = w + theta x w / 2 + b theta x (theta x w),
    b = (1 - phi/2 cot(phi/2))/phi^2,   phi = |theta|

which is exact (Hairer, Lubich and Wanner, Geometric Numerical Integration, 2006, IV.7), so every integrator keeps its
order on the rotations; a step ends by taking theta into the quaternion, which is made a unit one again. At its
beginning theta is 0, and its slope w: so semi-implicit Euler turns the body with the new rate.

In a case's memory, for a payload `box` (`payload:box:...`):

    x.q ... turn_z.qd, orientation.w ...    its state while it flies (`bodies`); at rest while a link carries it
    stage                                   FLYING, CARRIED or RELEASED
    held.0 ... 11                           its pose in the link's frame, rows of R then p, while a link carries it
    body.0 ... 9                            its inertia in the recursion's frame (`in_tree`); zeros while it flies

So the derivative adds ten numbers to the arm's, whatever happened when, and cases of a block may differ in that.
"""

from __future__ import annotations

from collections.abc import Mapping

from met.dynamics.kinematics import LinkMotion, fixed_motion
from met.dynamics.payload import free_acceleration, in_tree, loaded, raised
from met.dynamics.recursion import Wrench
from met.dynamics.spatial import (
    NO_INERTIA,
    Pose,
    Real,
    Rigid,
    add,
    choose,
    compose,
    cross,
    is_zero,
    rigid_about_centre,
    rotation_quaternion,
    rotation_rpy,
    scale,
    turn_vector,
    turn_vector_back,
)
from met.dynamics.tree import Tree
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan import BASE, Payload
from met.program import cells
from met.program.system import ReadCell, System
from met.trace import Truth, cos, sin, sqrt, where
from met.trace.program import Tape
from met.vectors import ZERO, Quaternion, Vector, composed, quaternion_rpy

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
        return tuple(cells.BODY_ORIENTATION(self.name, part) for part in "wxyz")

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
    """Three numbers of a rotation vector of length phi: phi^2, phi/2 (1 where phi is 0, so that it may divide), and the
    sine of the second."""
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


FLYING, CARRIED, RELEASED = 0.0, 1.0, 2.0
"""Stages of a payload: it flies until it is grappled; a link carries it; it flies for the rest of the run."""

NOTHING: Wrench = (ZERO, ZERO)


def body_of(system: System, payload: Payload, read: ReadCell) -> Rigid:
    """A payload's inertia in its own frame."""
    name = payload.name
    return rigid_about_centre(system.mass(name, read), system.com(name, read), system.inertia(name, read))


def free_body(system: System, payload: Payload) -> FreeBody:
    """The body of a payload in flight, with its coordinates."""
    return next(body for body in bodies(system) if body.name == PAYLOAD + payload.name)


def carried(payload: Payload, read: ReadCell) -> Truth:
    """True where a link carries the payload."""
    return read(cells.PAYLOAD_STAGE(payload.name)) == CARRIED


def pose_in_link(payload: Payload, read: ReadCell) -> Pose:
    """The payload's pose in the link's frame, while the link carries it."""
    x = [read(cells.PAYLOAD_POSE(payload.name, i)) for i in range(12)]
    return Pose(((x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8])), (x[9], x[10], x[11]))


def tree_with_payloads(system: System, read: ReadCell) -> Tree:
    """The arm with the payloads that its links carry."""
    tree = system.tree(read)
    for payload in system.flying:
        x = [read(cells.PAYLOAD_BODY(payload.name, i)) for i in range(10)]
        body = Rigid(x[0], (x[1], x[2], x[3]), (x[4], x[5], x[6], x[7], x[8], x[9]))
        tree = loaded(tree, payload.link, body)
    return tree


def payload_motion(
    system: System, payload: Payload, read: ReadCell, y: Motion, links: Mapping[str, LinkMotion]
) -> LinkMotion:
    """A payload in the world, wherever it is; links: the arm's, in the world."""
    own, link = flying_motion(system, payload, read, y), carried_motion(payload, read, links)
    on = carried(payload, read)

    def either(a: Vector, b: Vector) -> Vector:
        return choose(on, a[0], b[0]), choose(on, a[1], b[1]), choose(on, a[2], b[2])

    x, y_, z = (either(a, b) for a, b in zip(link.pose.R, own.pose.R, strict=True))
    return LinkMotion(Pose((x, y_, z), either(link.pose.p, own.pose.p)), either(link.w, own.w), either(link.v, own.v))


def flying_motion(system: System, payload: Payload, read: ReadCell, y: Motion) -> LinkMotion:
    """Pose and velocity of a payload in free flight, which no link carries at present."""
    flying = flight(free_body(system, payload), read, y)
    return LinkMotion(flying.pose, flying.w, flying.v)


def carried_motion(payload: Payload, read: ReadCell, links: Mapping[str, LinkMotion]) -> LinkMotion:
    """A payload that its link carries, in the world."""
    link, pose = links[payload.link], pose_in_link(payload, read)
    return LinkMotion(compose(link.pose, pose), *fixed_motion((link.w, link.v), pose))


def split_wrenches(system: System, read: ReadCell, wrenches: Mapping[str, Wrench]) -> tuple[dict[str, Wrench], ...]:
    """Wrenches on links, including those on payloads that a link carries; and wrenches on payloads that move freely.

    wrenches on links and payloads by name, about their frames' origins and in their axes
    """
    names = {payload.name: payload for payload in system.flying}
    links = {name: wrench for name, wrench in wrenches.items() if name not in names}
    own = {name: wrench for name, wrench in wrenches.items() if name in names}
    for name, wrench in own.items():
        payload = names[name]
        on = carried(payload, read)
        before = links.get(payload.link, NOTHING)
        felt = raised(wrench, pose_in_link(payload, read))
        links[payload.link] = tuple(  # type: ignore[assignment]
            tuple(a + choose(on, b, 0.0) for a, b in zip(*parts, strict=True))
            for parts in zip(before, felt, strict=True)
        )
    return links, own


def slopes_of_payloads(
    system: System, read: ReadCell, y: Motion, wrenches: Mapping[str, Wrench], gravity: Vector
) -> tuple[tuple[Real, ...], tuple[Real, ...]]:
    """Slopes of the payloads' coordinates and rates; none while a link carries them. gravity: world axes, m/s^2."""
    qd: list[Real] = []
    qdd: list[Real] = []
    for payload in system.flying:
        body = free_body(system, payload)
        flying = flight(body, read, y)
        falling = turn_vector_back(flying.pose.R, gravity)
        wrench = wrenches.get(payload.name, NOTHING)
        solved = free_acceleration(body_of(system, payload, read), flying.w, wrench, falling)
        on = carried(payload, read)
        for collected, free in zip(
            (qd, qdd), slopes(body, y, pose=flying.pose, turned=flying.turned, solved=solved), strict=True
        ):
            collected += [choose(on, 0.0, slope) for slope in free]
    return tuple(qd), tuple(qdd)


# Changes of stage


def start(system: System, tape: Tape) -> None:
    """Write the payloads' state at the start of a run."""
    for payload in system.flying:
        head = f"payloads.{payload.name}"

        def parameter(name: str, head: str = head) -> Vector:
            return system.vector(f"{head}.{name}", tape.read)

        body = free_body(system, payload)
        if payload.grappled:
            turn = quaternion_rpy(*parameter("attitude"))
            w = turn_vector_back(rotation_quaternion(*turn), parameter("rate"))
            place(body, tape, True, turn, parameter("position"), parameter("velocity"), w)
            tape.write(cells.PAYLOAD_STAGE(payload.name), FLYING)
        else:
            place(body, tape, True, (1.0, 0.0, 0.0, 0.0), ZERO, ZERO, ZERO)
            attach(system, tape, True, payload, Pose(rotation_rpy(*parameter("rpy")), parameter("at")))


def attach(system: System, tape: Tape, active: Truth, payload: Payload, pose: Pose) -> None:
    """Attach a payload to its link, at this pose in its frame, where active."""
    for i, x in enumerate((*pose.R[0], *pose.R[1], *pose.R[2], *pose.p)):
        cells.keep(tape, active, cells.PAYLOAD_POSE(payload.name, i), x)
    body = in_tree(system.tree(tape.read), payload.link, body_of(system, payload, tape.read), pose)
    _keep_body(tape, active, payload, body)
    cells.keep(tape, active, cells.PAYLOAD_STAGE(payload.name), CARRIED)


def detach(tape: Tape, active: Truth, payload: Payload) -> None:
    """Detach a payload from its link, where active."""
    _keep_body(tape, active, payload, NO_INERTIA)
    cells.keep(tape, active, cells.PAYLOAD_STAGE(payload.name), RELEASED)


def gap(system: System, payload: Payload, read: ReadCell, motion: LinkMotion, link: LinkMotion) -> Vector:
    """The vector from the link's point to which the payload's frame should come, to that frame; world axes, m."""
    x, y, z = motion.pose.p
    a, b, c = link.position(system.vector(f"payloads.{payload.name}.at", read))
    return x - a, y - b, z - c


def _keep_body(tape: Tape, active: Truth, payload: Payload, body: Rigid) -> None:
    for i, x in enumerate((body.mass, *body.h, *body.I)):
        cells.keep(tape, active, cells.PAYLOAD_BODY(payload.name, i), x)
