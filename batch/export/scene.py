"""What the links look like: the deck's shapes as foxglove's primitives, each fixed to its link's frame.

A rod, a box and a cylinder begin at the link frame's origin and extend along one of its axes; a sphere is centred there
(ic/meaning/mechanics/shapes.py). Where the deck writes a centre of mass and leaves the inertia to the shape, the solid
that is simulated is centred on it, and so it is drawn. A link without a shape is a line to each joint that it carries,
or to its centre of mass. Joints are drawn besides: a short cylinder about the axis of a revolute joint, and for a
prismatic one a cube on a rail, which is as long as the case uses it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from batch.export.poses import PosedArm
from batch.export.wire import plain
from batch.plotting.sheet import COLOURS
from met.dynamics.spatial import IDENTITY, Pose, compose, rotation_rpy
from met.plan import BASE, Joint, Link, Payload

Vector = tuple[float, float, float]

LINKS = COLOURS[:-1]
"""Colours of the links in turn; the last, black, is not seen before a dark background."""

JOINTS = "#8a939c"
GHOST = 0.22
"""Opacity of every case but the first."""

ROD, JOINT_RADIUS, JOINT_LENGTH, MASS = 0.02, 0.02, 0.05, 0.015
"""Radii and lengths of what has none: of a rod, in its own lengths; of others, in the arm's size."""

SIZES = {
    "rod": ("length",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "box": ("size_x", "size_y", "size_z"),
}
"""Parameters of the shapes that are drawn; a link of another shape, which a later MET may know, is drawn as one
without."""

LINE_PIXELS = 4.0
ORIGIN: Vector = (0.0, 0.0, 0.0)


def size(arms: Sequence[PosedArm]) -> float:
    """The reach of the arms from the base, m, about."""
    far = 0.0
    for arm in arms:
        for link in arm.experiment.structure.links:
            sizes = shape_of(arm, link)[1] if drawn(link) else {}
            own = max((value for name, value in sizes.items() if name != "along"), default=0.0)
            far = max(far, float(np.linalg.norm(arm.place[link.name])) + own)
    return far if 0.0 < far < math.inf else 1.0


def scene(arm: PosedArm, root: str, ghost: bool, size: float) -> Any:
    """The SceneUpdate that puts an arm in place; its links' frames move it from then on. root: frame of the base."""
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    structure = arm.experiment.structure
    opacity = GHOST if ghost else 1.0
    carried: dict[str, list[Joint]] = {}
    for joint in structure.joints:
        carried.setdefault(joint.parent, []).append(joint)
    carrier = {joint.child: joint for joint in structure.joints}
    out = SceneUpdate()
    grey = _colour(JOINTS, opacity)
    if all(link.name != BASE for link in structure.links):
        ground = _entity(out, root, f"{arm.prefix}{BASE}")
        _draw(ground, [(ORIGIN, _at(arm, joint)) for joint in carried.get(BASE, ())], grey)
        _draw(ground, _rails(arm, carried.get(BASE, ())), grey)
    payloads = [payload for payload in structure.payloads if payload.name in arm.poses]
    bodies: list[Link | Payload] = [*structure.links, *payloads]
    for number, link in enumerate(bodies):
        entity = _entity(out, arm.prefix + link.name, arm.prefix + link.name)
        colour = _colour(LINKS[number % len(LINKS)], opacity)
        what = "payload" if isinstance(link, Payload) else "link"
        told = {what: link.name, "mass": f"{arm.values.get(f'{head(link)}.mass', math.nan):g} kg"}
        if drawn(link):
            kind, numbers = shape_of(arm, link)
            _solid(entity, kind, numbers, _middle(arm, link, kind, numbers), colour)
            told["shape"] = kind
        else:
            _bare(entity, arm, link, carried.get(link.name, ()), colour, size)
        if link.name in carrier:
            _joint(entity, arm, carrier[link.name], grey, size)
        _draw(entity, _rails(arm, carried.get(link.name, ())), grey)
        for key, value in told.items():
            entity.metadata.add(key=key, value=plain(value))
    return out


def head(link: Link | Payload) -> str:
    """The beginning of the paths of a link's or payload's parameters."""
    return f"payloads.{link.name}" if isinstance(link, Payload) else f"links.{link.name}"


def drawn(link: Link | Payload) -> bool:
    """True if a link has a shape that is drawn."""
    return link.shape is not None and set(SIZES.get(link.shape[0], ("none",))) <= set(dict(link.shape[1]))


def shape_of(arm: PosedArm, link: Link | Payload) -> tuple[str, dict[str, float]]:
    """A link's shape in this case: kind and sizes, in m; `along` as 0, 1 or 2.

    The plan has the sizes of its first case. Where a sweep varies a size by its path, this case has its own; and where
    a length follows from something else that varies, it is twice as far as the shape's centre, which the case has.
    """
    assert link.shape is not None
    kind, numbers = link.shape
    sizes = dict(numbers)
    along = "xyz"[int(sizes.get("along", 0.0))]
    length = f"size_{along}" if kind == "box" else "length"
    centre = f"{head(link)}.com.{along}"
    before, now = arm.first.get(centre, math.nan), arm.values.get(centre, math.nan)
    if length in sizes and now > 0.0 and math.isclose(2.0 * before, sizes[length], rel_tol=1e-9):
        sizes[length] = 2.0 * now
    group = arm.case.group
    varied = {v.path: float(group.at(v.name, [arm.case.position])[0]) for v in group.role("coordinate")}
    for name in sizes:
        path = f"{head(link)}.shape.{name}".replace("size_", "size.")
        sizes[name] = varied.get(path, sizes[name])
    return kind, sizes


# Primitives


def _entity(scene: Any, frame: str, name: str) -> Any:
    """An entity that stays and moves with its frame."""
    entity = scene.entities.add(frame_id=frame, id=name, frame_locked=True)
    entity.timestamp.SetInParent()
    entity.lifetime.SetInParent()
    return entity


def _middle(arm: PosedArm, link: Link | Payload, kind: str, numbers: Mapping[str, float]) -> Vector:
    """The middle of a link's shape in the link's frame, m."""
    inertia = arm.experiment.parameters.get(f"{head(link)}.inertia.xx")
    if inertia is not None and inertia.origin.kind != "deck":
        return _numbers(arm, f"{head(link)}.com", "xyz")
    axis = _axis(numbers)
    lengths = {"sphere": 0.0, "box": numbers.get(f"size_{'xyz'[axis.index(1.0)]}", 0.0)}
    return _scaled(axis, lengths.get(kind, numbers.get("length", 0.0)) / 2.0)


def _axis(numbers: Mapping[str, float]) -> Vector:
    """Along which a shape extends."""
    x, y, z = (float(each == int(numbers.get("along", 0.0))) for each in range(3))
    return (x, y, z)


def _solid(entity: Any, kind: str, numbers: Mapping[str, float], middle: Vector, colour: Any) -> None:
    if kind == "sphere":
        entity.spheres.add(pose=_pose(middle), size=_vector((2 * numbers["radius"],) * 3), color=colour)
    elif kind == "box":
        edges = (numbers["size_x"], numbers["size_y"], numbers["size_z"])
        entity.cubes.add(pose=_pose(middle), size=_vector(edges), color=colour)
    else:
        length = numbers["length"]
        _cylinder(entity, middle, _axis(numbers), numbers.get("radius", ROD * length), length, colour)


def _bare(entity: Any, arm: PosedArm, link: Link | Payload, carried: Sequence[Joint], colour: Any, size: float) -> None:
    """A link that has no shape: lines to its joints, or to its centre of mass."""
    com = _numbers(arm, f"{head(link)}.com", "xyz")
    ends = [_at(arm, joint) for joint in carried] or [com]
    _draw(entity, [(ORIGIN, end) for end in ends], colour)
    if not carried:
        entity.spheres.add(pose=_pose(com), size=_vector((2 * MASS * size,) * 3), color=colour)


def _joint(entity: Any, arm: PosedArm, joint: Joint, colour: Any, size: float) -> None:
    """The joint that carries a link, in the link's frame."""
    radius, length = JOINT_RADIUS * size, JOINT_LENGTH * size
    if joint.kind == "revolute":
        axis, pivot = _numbers(arm, f"{joint.name}.axis", "xyz"), _numbers(arm, f"{joint.name}.pivot", "xyz")
        _cylinder(entity, pivot, axis, radius, length, colour)
    elif joint.kind == "prismatic":
        entity.cubes.add(pose=_pose(ORIGIN), size=_vector((2 * radius,) * 3), color=colour)


def _cylinder(entity: Any, middle: Vector, axis: Vector, radius: float, length: float, colour: Any) -> None:
    pose, extent = _pose(middle, turned_to(axis)), _vector((2 * radius, 2 * radius, length))
    entity.cylinders.add(pose=pose, size=extent, bottom_scale=1.0, top_scale=1.0, color=colour)


def _rails(arm: PosedArm, carried: Sequence[Joint]) -> list[tuple[Vector, Vector]]:
    """The ends of the rails of joints that slide on a link, in the link's frame, m."""
    out = []
    for joint in carried:
        if joint.name in arm.travel:
            axis, turn = (_numbers(arm, f"{joint.name}.{name}", "xyz") for name in ("axis", "rpy"))
            frame = Pose(rotation_rpy(*turn), _at(arm, joint))
            low, high = (_point(compose(frame, Pose(IDENTITY, _scaled(axis, q))).p) for q in arm.travel[joint.name])
            out.append((low, high))
    return out


def _point(numbers: Sequence[Any]) -> Vector:
    x, y, z = map(float, numbers)
    return (x, y, z)


def _draw(entity: Any, lines: Sequence[tuple[Vector, Vector]], colour: Any) -> None:
    """Lines from a point to another, those that have a length."""
    from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
    from foxglove_schemas_protobuf.Point3_pb2 import Point3

    points = [Point3(x=x, y=y, z=z) for ends in lines if math.dist(*ends) > 0.0 for x, y, z in ends]
    if points:
        entity.lines.add(
            type=LinePrimitive.LINE_LIST,
            pose=_pose(ORIGIN),
            thickness=LINE_PIXELS,
            scale_invariant=True,
            points=points,
            color=colour,
        )


def turned_to(axis: Vector) -> tuple[float, float, float, float]:
    """The unit quaternion (w, x, y, z) that turns z to a direction by the shortest way."""
    length = math.hypot(*axis) or 1.0
    x, y, z = (part / length for part in axis)
    if z < -1.0 + 1e-12:
        return (0.0, 1.0, 0.0, 0.0)
    w = math.sqrt((1.0 + z) / 2.0)
    return (w, -y / (2.0 * w), x / (2.0 * w), 0.0)


def _pose(position: Vector, turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)) -> Any:
    from foxglove_schemas_protobuf.Pose_pb2 import Pose as Placed
    from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion

    w, x, y, z = turn
    return Placed(position=_vector(position), orientation=Quaternion(x=x, y=y, z=z, w=w))


def _vector(numbers: Sequence[float]) -> Any:
    from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

    x, y, z = numbers
    return Vector3(x=x, y=y, z=z)


def _colour(hexadecimal: str, opacity: float) -> Any:
    from foxglove_schemas_protobuf.Color_pb2 import Color

    r, g, b = (int(hexadecimal[at : at + 2], 16) / 255.0 for at in (1, 3, 5))
    return Color(r=r, g=g, b=b, a=opacity)


# Numbers of the case


def _at(arm: PosedArm, joint: Joint) -> Vector:
    """The position of a joint's frame in its parent link's, m."""
    return _numbers(arm, f"{joint.name}.at", "xyz")


def _numbers(arm: PosedArm, path: str, parts: str) -> Vector:
    x, y, z = (arm.values.get(f"{path}.{part}", 0.0) for part in parts)
    return (x, y, z)


def _scaled(vector: Vector, factor: float) -> Vector:
    x, y, z = vector
    return (factor * x, factor * y, factor * z)
