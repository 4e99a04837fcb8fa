"""The looks of the links: the deck's shapes as simple solids and lines, each fixed to its link's frame.

A rod, a box and a cylinder begin at the link frame's origin and extend along one of its axes; a sphere is centred there
(ic/meaning/mechanics/matter.py). Where the deck writes a centre of mass and leaves the inertia to the shape, the
simulated solid is centred on it, and it is drawn there. A link without a shape is a line to each joint that it carries,
or to its centre of mass. Joints are drawn besides: a short cylinder about the axis of a revolute joint, and for a
prismatic one a cube on a rail, which is as long as the case uses it; and a ball at the pin of a loop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

from met.dynamics.spatial import IDENTITY, ZERO, Pose, Real, Vector, compose, is_zero, rotation_rpy, scale, sub
from met.frozen import frozen
from met.plan import BASE, Experiment, Joint, Link, Payload
from met.plan.closing import of_joints

SIZES = {
    "rod": ("length",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "box": ("size_x", "size_y", "size_z"),
}
"""Parameters of the shapes that are drawn; a link of another shape, which a later MET may have, is drawn like one
without."""

JOINT_RADIUS, JOINT_LENGTH, MASS = 0.02, 0.05, 0.015
"""Default radii and lengths, relative to the arm's size: of a joint, of a point with mass."""


@frozen
class ArmNumbers:
    """The numbers that determine an arm's shapes, floats or traced.

    values  a case's parameters by path, in SI;  varied  those of them that the sweep varies by themselves
    first   the values of the case in which shapes are as the plan has them
    travel  of each joint that slides: the stretch of q, 0 in it, that is used, m
    size    the arm's, m, by which joints are drawn
    """

    experiment: Experiment
    values: Mapping[str, Real]
    varied: Mapping[str, Real]
    first: Mapping[str, float]
    travel: Mapping[str, tuple[Real, Real]]
    size: float


@frozen
class ArmShape:
    """A solid or a line in the frame of a body, m.

    role    what it is of; of a "joint" `joint` is its name
    middle  of the solid; of a line where it begins
    axis    along which a cylinder or a rod extends; of a line the way to its end
    size    edges of a box; radius, radius and length of a cylinder; radii of a sphere; of a rod 0, 0 and its length
    """

    kind: Literal["box", "cylinder", "sphere", "rod", "line"]
    role: Literal["link", "payload", "joint", "rail"]
    middle: Vector
    axis: Vector
    size: Vector = ZERO
    joint: str = ""


def shapes(arm: ArmNumbers, bodies: Sequence[Link | Payload]) -> dict[str, list[ArmShape]]:
    """The solids of each of these bodies, and of the base where it is no link, by name."""
    structure = arm.experiment.structure
    carried: dict[str, list[Joint]] = {}
    ends: dict[str, list[Vector]] = {}  # of lines, by the body from whose origin they are drawn
    for joint in structure.joints:
        carried.setdefault(joint.parent, []).append(joint)
        ends.setdefault(joint.parent, []).append(numbers(arm.values, f"{joint.name}.at"))
    pins: dict[str, list[ArmShape]] = {}
    radius = MASS * arm.size
    for loop in of_joints(structure.joints).values():
        ends.setdefault(loop.to, []).append(numbers(arm.values, f"{loop.name}.to_at"))
        ends.setdefault(loop.link, []).append(pin := numbers(arm.values, f"{loop.name}.at"))
        ball = ArmShape("sphere", "joint", pin, (0.0, 0.0, 1.0), (radius, radius, radius))
        pins.setdefault(loop.link, []).append(ball)
    carrier = {joint.child: joint for joint in structure.joints}
    out: dict[str, list[ArmShape]] = {}
    if all(link.name != BASE for link in structure.links):
        lines = [line("joint", ZERO, end) for end in ends.get(BASE, [])]
        out[BASE] = [*lines, *_rails(arm, carried.get(BASE, []))]
    for body in bodies:
        role: Literal["link", "payload"] = "payload" if isinstance(body, Payload) else "link"
        solids = [_solid(arm, body, role)] if drawn(body) else _bare(arm, body, ends.get(body.name, ()), role)
        if isinstance(body, Link) and body.root:
            solids = []  # it is drawn by its pieces
        if body.name in carrier and carrier[body.name].name not in structure.springs:
            solids += _joint(arm, carrier[body.name])
        out[body.name] = [*solids, *pins.get(body.name, ()), *_rails(arm, carried.get(body.name, ()))]
    return {name: [shape for shape in solids if _is_visible(shape)] for name, solids in out.items()}


def head(body: Link | Payload) -> str:
    """The prefix of the paths of a link's or payload's parameters."""
    return f"payloads.{body.name}" if isinstance(body, Payload) else f"links.{body.name}"


def drawn(body: Link | Payload) -> bool:
    """True if a body has a shape that is drawn."""
    return body.shape is not None and set(SIZES.get(body.shape[0], ("none",))) <= set(dict(body.shape[1]))


def shape_of(arm: ArmNumbers, body: Link | Payload) -> tuple[str, dict[str, Real]]:
    """A body's shape: kind and sizes, in m; `along` as 0, 1 or 2.

    The plan has the sizes of its first case. Where a sweep varies a size by its path, a case has its own; and where a
    length depends on another varied parameter, it is twice the distance of the shape's centre, which is known for each
    case.
    """
    assert body.shape is not None
    kind, written_sizes = body.shape
    sizes: dict[str, Real] = dict(written_sizes)
    along = "xyz"[int(dict(written_sizes).get("along", 0.0))]
    length = f"size_{along}" if kind == "box" else "length"
    centre = f"{head(body)}.com.{along}"
    before, now = arm.first.get(centre, math.nan), arm.values.get(centre)
    if (
        now is not None
        and length in sizes
        and before > 0.0
        and math.isclose(2.0 * before, dict(written_sizes)[length], rel_tol=1e-9)
    ):
        sizes[length] = 2.0 * now
    for name in sizes:
        path = f"{head(body)}.shape.{name}".replace("size_", "size.")
        sizes[name] = arm.varied.get(path, sizes[name])
    return kind, sizes


def _solid(arm: ArmNumbers, body: Link | Payload, role: Literal["link", "payload"]) -> ArmShape:
    """The drawn solid of a link or payload, from the shape that the deck gives it, in metres in its frame."""
    kind, sizes = shape_of(arm, body)
    along = int(dict(body.shape[1]).get("along", 0.0)) if body.shape is not None else 0
    axis: Vector = (float(along == 0), float(along == 1), float(along == 2))
    inertia = arm.experiment.parameters.get(f"{head(body)}.inertia.xx")
    if inertia is not None and inertia.origin.kind != "deck":
        middle = numbers(arm.values, f"{head(body)}.com")
    else:
        lengths = {"sphere": 0.0, "box": sizes.get(f"size_{'xyz'[along]}", 0.0)}
        middle = scale(lengths.get(kind, sizes.get("length", 0.0)) / 2.0, axis)
    if kind == "sphere":
        return ArmShape("sphere", role, middle, axis, (sizes["radius"],) * 3)
    if kind == "box":
        return ArmShape("box", role, middle, axis, (sizes["size_x"], sizes["size_y"], sizes["size_z"]))
    radius = sizes["radius"] if kind == "cylinder" else 0.0
    return ArmShape("cylinder" if kind == "cylinder" else "rod", role, middle, axis, (radius, radius, sizes["length"]))


def _bare(
    arm: ArmNumbers, body: Link | Payload, ends: Sequence[Vector], role: Literal["link", "payload"]
) -> list[ArmShape]:
    """The shapes of a body without one of its own: lines to these ends, its joints and pins, or to its centre of
    mass."""
    if ends:
        return [line(role, ZERO, end) for end in ends]
    com, radius = numbers(arm.values, f"{head(body)}.com"), MASS * arm.size
    return [line(role, ZERO, com), ArmShape("sphere", role, com, (0.0, 0.0, 1.0), (radius, radius, radius))]


def _joint(arm: ArmNumbers, joint: Joint) -> list[ArmShape]:
    """The shape of the joint that carries a link, in the link's frame."""
    radius, length = JOINT_RADIUS * arm.size, JOINT_LENGTH * arm.size
    if joint.kind == "revolute":
        axis, pivot = numbers(arm.values, f"{joint.name}.axis"), numbers(arm.values, f"{joint.name}.pivot")
        return [ArmShape("cylinder", "joint", pivot, axis, (radius, radius, length), joint.name)]
    if joint.kind == "prismatic":
        return [ArmShape("box", "joint", ZERO, (0.0, 0.0, 1.0), (2 * radius, 2 * radius, 2 * radius), joint.name)]
    return []


def _rails(arm: ArmNumbers, carried: Sequence[Joint]) -> list[ArmShape]:
    """The rails of prismatic joints on a link, in the link's frame."""
    out = []
    for joint in carried:
        if joint.name in arm.travel:
            axis, turn = (numbers(arm.values, f"{joint.name}.{name}") for name in ("axis", "rpy"))
            frame = Pose(rotation_rpy(*turn), numbers(arm.values, f"{joint.name}.at"))
            low, high = (compose(frame, Pose(IDENTITY, scale(q, axis))).p for q in arm.travel[joint.name])
            out.append(line("rail", low, high))
    return out


def line(role: Literal["link", "payload", "joint", "rail"], begin: Vector, end: Vector) -> ArmShape:
    """A line between two points of a body's frame, m."""
    return ArmShape("line", role, begin, sub(end, begin))


def numbers(values: Mapping[str, Real], path: str) -> Vector:
    """The three numbers of a vector parameter among a case's parameters by path; zeros where it does not exist."""
    x, y, z = (values.get(f"{path}.{part}", 0.0) for part in "xyz")
    return (x, y, z)


def _is_visible(shape: ArmShape) -> bool:
    """False for a line that has no length in any case."""
    return shape.kind != "line" or not all(map(is_zero, shape.axis))
