"""Solids of an arm as polygons of a picture from one viewpoint, sorted from back to front, so that paper needs no
renderer."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from batch.arms.look import AZIMUTH, CUBE, FIELD, FLAT, FOOT, HIGH, JOINT, LOW, RAIL, ROOM
from batch.arms.scene import POSE_NUMBERS, SHAPE_NUMBERS, ArmScene
from met.frozen import frozen

ROUND = 28
"""Number of corners of a circle."""


@frozen
class PicturedSolid:
    """A solid in the world, z up, m: a "pill" or "can" from one end to another, or a "block" of three edges.

    ends    of its axis (2, 3);  axes: of a block, rows, each half an edge long
    """

    kind: str
    role: str
    joint: int
    ends: np.ndarray
    axes: np.ndarray
    radius: float


def upright(scene: ArmScene) -> np.ndarray:
    """The rotation that takes the world's axes to those in which `up` is z."""
    return np.stack(_along(np.array(scene.up)), axis=0) if scene.up != (0.0, 0.0, 1.0) else np.eye(3)


def solids(scene: ArmScene, numbers: np.ndarray) -> Iterator[PicturedSolid]:
    """The arm at an instant. numbers: the outputs of the scene's formulas there."""
    up, limb = upright(scene), scene.limb
    count = POSE_NUMBERS * len(scene.bodies)
    poses, shape_numbers = numbers[:count].reshape(-1, POSE_NUMBERS), numbers[count:-3].reshape(-1, SHAPE_NUMBERS)
    for shape, (*middle_and_axis, x, y, z) in zip(scene.shapes, shape_numbers, strict=True):
        R, p = up @ poses[shape.body][:9].reshape(3, 3), up @ poses[shape.body][9:]
        middle, axis = p + R @ np.array(middle_and_axis[:3]), R @ np.array(middle_and_axis[3:])
        length, radius, kind = float(np.linalg.norm(axis)), limb, "pill"
        way = axis / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        axes = np.zeros((3, 3))
        if shape.kind == "line":
            middle = middle + axis / 2.0
        elif shape.kind == "sphere":
            length, radius = 0.0, x
        elif shape.kind == "box":
            kind, edges = "block", np.full(3, CUBE * limb) if shape.role == "joint" else np.array([x, y, z])
            axes = 0.5 * edges[:, None] * R.T
            length, radius, way = float(edges[2]), float(math.hypot(edges[0], edges[1])) / 2.0, R[:, 2]
        else:
            length = z
            if shape.kind == "cylinder":
                kind, radius = "can", x
                if shape.role == "joint":
                    radius, length = JOINT[0] * limb, JOINT[1] * limb
        radius = RAIL * limb if shape.role == "rail" else radius
        ends = np.stack([middle - way * length / 2.0, middle + way * length / 2.0])
        yield PicturedSolid(kind, shape.role, shape.joint, ends, axes, radius)
    if not scene.moves:
        foot = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, FOOT[1] * limb]])
        yield PicturedSolid("can", "base", -1, foot, np.zeros((3, 3)), FOOT[0] * limb)


@frozen
class Viewpoint:
    """A viewpoint of a picture: right, up and back (to the eye) in the world, and the eye."""

    right: np.ndarray
    up: np.ndarray
    back: np.ndarray
    eye: np.ndarray

    def see(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) as right, up and far (..., 3): the first two by the distance, without a unit."""
        v = points - self.eye
        far = -(v @ self.back)
        return np.stack([(v @ self.right) / far, (v @ self.up) / far, far], axis=-1)


def viewpoint(pictured: Sequence[PicturedSolid], aspect: float) -> Viewpoint:
    """The direction from which the spread of these solids is seen best, from higher where it is flat; at such a
    distance that all are seen in a picture of this ratio of width to height."""
    points = np.concatenate([solid.ends for solid in pictured])
    radii = np.repeat([solid.radius for solid in pictured], 2)
    spread = np.cov(points.T, bias=True)
    across = float(spread[0, 0] + spread[1, 1])
    elevation = HIGH if spread[2, 2] < FLAT * across else LOW
    best, axes = -1.0, _axes(AZIMUTH, elevation)
    for number in range(36):
        azimuth = AZIMUTH + number * math.pi / 18.0
        right, up, back = _axes(azimuth, elevation)
        area = float(np.linalg.det(np.stack([right, up]) @ spread @ np.stack([right, up]).T))
        area += 1e-3 * (1.0 + math.cos(azimuth - AZIMUTH)) * across**2
        if area > best:
            best, axes = area, (right, up, back)
    right, up, back = axes
    middle = [
        (float(np.min(points @ axis - radii)) + float(np.max(points @ axis + radii))) / 2.0 for axis in (right, up)
    ]
    target = right * middle[0] + up * middle[1] + back * float(np.mean(points @ back))
    v = points - target
    sides = np.maximum((np.abs(v @ right) + radii) / (FIELD * aspect), (np.abs(v @ up) + radii) / FIELD)
    return Viewpoint(right, up, back, target + back * ROOM * float(np.max(v @ back + sides)))


@frozen
class Facet:
    """A polygon of the picture (corner, 2); light: how it is lit, 1 fully; far: its distance, by which it is sorted."""

    corners: np.ndarray
    light: float
    far: float
    edge: bool = True


def facets(solid: PicturedSolid, view: Viewpoint) -> list[Facet]:
    """The polygons of a solid, back to front."""
    key = view.back - 0.7 * view.right + view.up
    key = key / np.linalg.norm(key)

    def lit(normal: np.ndarray) -> float:
        return 0.62 + 0.42 * (0.5 + 0.5 * float(normal @ key))

    ends = view.see(solid.ends)
    far = float(ends[:, 2].mean())
    turn = 2.0 * math.pi * np.arange(ROUND) / ROUND
    if solid.kind == "block":
        out = []
        middle = solid.ends.mean(axis=0)
        for k in range(3):
            for sign in (1.0, -1.0):
                face, (u, v) = middle + sign * solid.axes[k], (solid.axes[(k + 1) % 3], solid.axes[(k + 2) % 3])
                if sign * solid.axes[k] @ (view.eye - face) > 0.0:
                    normal = sign * solid.axes[k] / np.linalg.norm(solid.axes[k])
                    corners = view.see(np.stack([face + u + v, face - u + v, face - u - v, face + u - v]))
                    out.append(Facet(corners[:, :2], lit(normal), far))
        return out
    if solid.kind == "can":
        x, y, z = _along(solid.ends[1] - solid.ends[0])
        circle = solid.radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y)
        rings = [view.see(end + circle)[:, :2] for end in solid.ends]
        near = 1 if z @ (view.eye - solid.ends.mean(axis=0)) > 0.0 else 0
        top = lit(z if near else -z)
        return [Facet(hull(np.concatenate(rings)), 0.86, far), Facet(rings[near], top, far - 1e-9)]
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    radii = solid.radius / ends[:, 2]
    body = hull(np.concatenate([end[:2] + r * circle for end, r in zip(ends, radii, strict=True)]))
    gleam = [end[:2] + r * (0.13 * circle + [-0.28, 0.28]) for end, r in zip(ends, radii, strict=True)]
    return [Facet(body, 0.95, far), Facet(hull(np.concatenate(gleam)), 1.12, far - 1e-9, edge=False)]


def hull(points: np.ndarray) -> np.ndarray:
    """The corners round all points (Andrew's monotone chain)."""
    order = points[np.lexsort((points[:, 1], points[:, 0]))]

    def chain(rows: np.ndarray) -> list[np.ndarray]:
        out: list[np.ndarray] = []
        for p in rows:
            while len(out) > 1 and _side(out[-2], out[-1], p) <= 0.0:
                out.pop()
            out.append(p)
        return out[:-1]

    return np.array([*chain(order), *chain(order[::-1])])


def _side(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _axes(azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
    back, right = np.array([ce * ca, ce * sa, se]), np.array([-sa, ca, 0.0])
    return right, np.cross(back, right), back


def _along(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Three axes of which the last is along a direction."""
    z = axis / (np.linalg.norm(axis) or 1.0)
    x = np.cross([0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [1.0, 0.0, 0.0], z)
    x = x / np.linalg.norm(x)
    return x, np.cross(z, x), z
