"""A box as a file of each format of meshes."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

FACES = ((0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4), (2, 3, 7), (2, 7, 6), (1, 2, 6), (1, 6, 5))
FACES = (*FACES, (0, 4, 7), (0, 7, 3))
"""The sides of a box, two triangles each, wound to be seen from outside."""


def box(size: Sequence[float] = (1.0, 1.0, 1.0)) -> np.ndarray:
    """Triangles of a box from the origin, (triangle, corner, axis)."""
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], float)
    return (corners * size)[np.array(FACES)]


def binary_stl(triangles: np.ndarray, count: int | None = None) -> bytes:
    records = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    records["corners"] = triangles
    return (
        b"solid by name only".ljust(80) + struct.pack("<I", len(triangles) if count is None else count) + bytes(records)
    )


def text_stl(triangles: np.ndarray) -> bytes:
    lines = ["solid box"]
    for corners in triangles.tolist():
        vertices = [f"vertex {x} {y} {z}" for x, y, z in corners]
        lines += ["facet normal 0 0 1", "outer loop", *vertices, "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid box", ""]).encode()


def obj(triangles: np.ndarray, *, backwards: bool = False) -> bytes:
    points = [f"v {x} {y} {z}" for x, y, z in triangles.reshape(-1, 3).tolist()]
    first = -len(points) if backwards else 1
    faces = [f"f {first + n}/1/1 {first + n + 1}//2 {first + n + 2}" for n in range(0, len(points), 3)]
    return "\n".join(["# a box", "o box", *points, *faces, ""]).encode()
