"""The looks of the links (`batch.arms.shapes`) as foxglove's primitives, each fixed to its link's frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.arms.meshes import LinkMesh
from batch.arms.shapes import ArmNumbers, ArmShape, drawn, head, shape_of, shapes
from batch.export.poses import PosedArm
from batch.export.wire import plain
from batch.plotting.layout import COLOURS
from met.dynamics.spatial import Real
from met.plan import BASE, Link, Payload

Vector = tuple[float, float, float]

LINKS = COLOURS[:-1]
"""Colours of the links in turn, without the last, black, which is invisible on a dark background."""

JOINTS = "#8a939c"
GHOST = 0.22
"""Opacity of every case but the first."""

ROD = 0.02
"""Radius of a rod, which has no size of its own, relative to its length."""

LINE_PIXELS = 4.0
ORIGIN: Vector = (0.0, 0.0, 0.0)


def size(arms: Sequence[PosedArm]) -> float:
    """Approximate reach of the arms from the base, m."""
    far = 0.0
    for arm in arms:
        for link in arm.experiment.structure.links:
            sizes = shape_of(_numbers(arm, 1.0), link)[1] if drawn(link) else {}
            own = max((float(value) for name, value in sizes.items() if name != "along"), default=0.0)
            far = max(far, float(np.linalg.norm(arm.place[link.name])) + own)
    return far if 0.0 < far < math.inf else 1.0


def scene(arm: PosedArm, root: str, ghost: bool, size: float) -> Any:
    """The SceneUpdate that puts an arm in place; its links' frames move it from then on. root: frame of the base."""
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    structure = arm.experiment.structure
    opacity = GHOST if ghost else 1.0
    out = SceneUpdate()
    grey = _colour(JOINTS, opacity)
    payloads = [payload for payload in structure.payloads if payload.name in arm.poses]
    bodies: list[Link | Payload] = [*structure.links, *payloads]
    shapes_of = shapes(_numbers(arm, size), bodies)
    meshes = {mesh.link: mesh for mesh in arm.meshes.links}
    for name in meshes:
        shapes_of[name] = [shape for shape in shapes_of[name] if shape.role in ("joint", "rail")]
    if all(link.name != BASE for link in structure.links):
        entity = _entity(out, root, f"{arm.prefix}{BASE}")
        _draw(entity, shapes_of[BASE], grey, grey)
        _triangles(entity, meshes.get(BASE), grey)
    for number, link in enumerate(bodies):
        entity = _entity(out, arm.prefix + link.name, arm.prefix + link.name)
        what = "payload" if isinstance(link, Payload) else "link"
        metadata = {what: link.name, "mass": f"{arm.values.get(f'{head(link)}.mass', math.nan):g} kg"}
        if drawn(link) and link.shape is not None:
            metadata["shape"] = link.shape[0]
        own = _colour(LINKS[number % len(LINKS)], opacity)
        _draw(entity, shapes_of[link.name], own, grey)
        _triangles(entity, meshes.get(link.name), own)
        for key, value in metadata.items():
            entity.metadata.add(key=key, value=plain(value))
    return out


def _numbers(arm: PosedArm, size: float) -> ArmNumbers:
    case = arm.case
    varied = {v.path: float(case.value(v.name)) for v in case.group.role("coordinate")}
    return ArmNumbers(arm.experiment, arm.values, varied, arm.first, arm.travel, size)


# Primitives


def _entity(scene: Any, frame: str, name: str) -> Any:
    """An entity that is fixed to its frame."""
    entity = scene.entities.add(frame_id=frame, id=name, frame_locked=True)
    entity.timestamp.SetInParent()
    entity.lifetime.SetInParent()
    return entity


def _draw(entity: Any, arm_shapes: Sequence[ArmShape], own: Any, grey: Any) -> None:
    """The shapes of a body, the joints' and rails' in grey; lines of one role are one primitive."""
    for shape in arm_shapes:
        colour = own if shape.role in ("link", "payload") else grey
        middle, (x, y, z) = _point(shape.middle), _point(shape.size)
        if shape.kind == "sphere":
            entity.spheres.add(pose=_pose(middle), size=_vector((2 * x, 2 * y, 2 * z)), color=colour)
        elif shape.kind == "box":
            entity.cubes.add(pose=_pose(middle), size=_vector((x, y, z)), color=colour)
        elif shape.kind in ("cylinder", "rod"):
            radius = x if shape.kind == "cylinder" else ROD * z
            pose, extent = _pose(middle, turned_to(_point(shape.axis))), _vector((2 * radius, 2 * radius, z))
            entity.cylinders.add(pose=pose, size=extent, bottom_scale=1.0, top_scale=1.0, color=colour)
    for role in dict.fromkeys(shape.role for shape in arm_shapes if shape.kind == "line"):
        lines = [shape for shape in arm_shapes if shape.kind == "line" and shape.role == role]
        _lines(entity, lines, own if role in ("link", "payload") else grey)


def _lines(entity: Any, lines: Sequence[ArmShape], colour: Any) -> None:
    """Lines between pairs of points, without those of no length."""
    from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
    from foxglove_schemas_protobuf.Point3_pb2 import Point3

    points = []
    for shape in lines:
        begin, way = _point(shape.middle), _point(shape.axis)
        if any(way):
            points += [
                Point3(x=x, y=y, z=z) for x, y, z in (begin, _point([a + b for a, b in zip(begin, way, strict=True)]))
            ]
    if points:
        entity.lines.add(
            type=LinePrimitive.LINE_LIST,
            pose=_pose(ORIGIN),
            thickness=LINE_PIXELS,
            scale_invariant=True,
            points=points,
            color=colour,
        )


def _triangles(entity: Any, mesh: LinkMesh | None, colour: Any) -> None:
    """The mesh of a link, in its frame."""
    from foxglove_schemas_protobuf.Point3_pb2 import Point3

    if mesh is not None:
        points = [Point3(x=x, y=y, z=z) for x, y, z in mesh.points.tolist()]
        entity.triangles.add(pose=_pose(ORIGIN), points=points, color=colour, indices=mesh.faces.ravel().tolist())


def _point(numbers: Sequence[Real]) -> Vector:
    x, y, z = (float(number) for number in numbers)
    return (x, y, z)


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

    r, g, b = (int(hexadecimal[digit : digit + 2], 16) / 255.0 for digit in (1, 3, 5))
    return Color(r=r, g=g, b=b, a=opacity)
