"""Payloads that fly for a time: their motion, their part in the arm's dynamics, and their grapples.

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
    choose,
    compose,
    rigid_about_centre,
    rotation_quaternion,
    rotation_rpy,
    turn_vector_back,
)
from met.dynamics.tree import Tree
from met.integrators.integrator import Motion
from met.plan import Payload
from met.program import cell_names, cells
from met.program.motion.bodies import PAYLOAD, FreeBody, bodies, flight, place, slopes
from met.program.system import ReadCell, System
from met.trace import Truth
from met.trace.program import Tape
from met.vectors import ZERO, Vector, quaternion_rpy

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
    return read(cell_names.PAYLOAD_STAGE(payload.name)) == CARRIED


def pose_in_link(payload: Payload, read: ReadCell) -> Pose:
    """The payload's pose in the link's frame, while the link carries it."""
    x = [read(cell_names.PAYLOAD_POSE(payload.name, i)) for i in range(12)]
    return Pose(((x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8])), (x[9], x[10], x[11]))


def tree_with_payloads(system: System, read: ReadCell) -> Tree:
    """The arm with the payloads that its links carry."""
    tree = system.tree(read)
    for payload in system.flying:
        x = [read(cell_names.PAYLOAD_BODY(payload.name, i)) for i in range(10)]
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
    """A payload that flies, in the world."""
    flying = flight(free_body(system, payload), read, y)
    return LinkMotion(flying.pose, flying.w, flying.v)


def carried_motion(payload: Payload, read: ReadCell, links: Mapping[str, LinkMotion]) -> LinkMotion:
    """A payload that its link carries, in the world."""
    link, pose = links[payload.link], pose_in_link(payload, read)
    return LinkMotion(compose(link.pose, pose), *fixed_motion((link.w, link.v), pose))


def split_wrenches(system: System, read: ReadCell, wrenches: Mapping[str, Wrench]) -> tuple[dict[str, Wrench], ...]:
    """Wrenches on links, including those on payloads that a link carries; and wrenches on flying payloads.

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
            tape.write(cell_names.PAYLOAD_STAGE(payload.name), FLYING)
        else:
            place(body, tape, True, (1.0, 0.0, 0.0, 0.0), ZERO, ZERO, ZERO)
            attach(system, tape, True, payload, Pose(rotation_rpy(*parameter("rpy")), parameter("at")))


def attach(system: System, tape: Tape, active: Truth, payload: Payload, pose: Pose) -> None:
    """Attach a payload to its link, at this pose in its frame, where active."""
    for i, x in enumerate((*pose.R[0], *pose.R[1], *pose.R[2], *pose.p)):
        cells.keep(tape, active, cell_names.PAYLOAD_POSE(payload.name, i), x)
    body = in_tree(system.tree(tape.read), payload.link, body_of(system, payload, tape.read), pose)
    _keep_body(tape, active, payload, body)
    cells.keep(tape, active, cell_names.PAYLOAD_STAGE(payload.name), CARRIED)


def detach(tape: Tape, active: Truth, payload: Payload) -> None:
    """Detach a payload from its link, where active."""
    _keep_body(tape, active, payload, NO_INERTIA)
    cells.keep(tape, active, cell_names.PAYLOAD_STAGE(payload.name), RELEASED)


def gap(system: System, payload: Payload, read: ReadCell, motion: LinkMotion, link: LinkMotion) -> Vector:
    """The vector from the link's point to which the payload's frame should come, to that frame; world axes, m."""
    x, y, z = motion.pose.p
    a, b, c = link.position(system.vector(f"payloads.{payload.name}.at", read))
    return x - a, y - b, z - c


def _keep_body(tape: Tape, active: Truth, payload: Payload, body: Rigid) -> None:
    for i, x in enumerate((body.mass, *body.h, *body.I)):
        cells.keep(tape, active, cell_names.PAYLOAD_BODY(payload.name, i), x)
