"""Files of meshes as triangles: STL, binary and as text, and OBJ. Their files are of others.

Numbers are the file's own. Materials, textures, normals and names are left out. A file that contradicts itself is
refused as a whole, with the reason in words.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

MOST_IN_TEXT = 500_000
"""Largest number of triangles, and of an OBJ's points, in a file of text: each takes a kilobyte of memory as words."""

STL_HEAD, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL before its triangles, and of each triangle: a normal, three corners, two bytes."""

_LONGEST = 40  # characters of a number
_STL_CORNER = re.compile(rb"\bvertex\s+(\S{1,40})\s+(\S{1,40})\s+(\S{1,40})(?=\s)")
_OBJ_POINT = re.compile(rb"^[ \t]*v[ \t]+(\S{1,40})[ \t]+(\S{1,40})[ \t]+(\S{1,40})", re.MULTILINE)
_OBJ_FACE = re.compile(rb"^[ \t]*f[ \t]+([^\r\n]*)", re.MULTILINE)


class MeshFault(Exception):
    """The reason why a file is no mesh, in words that follow its name."""


def triangles(name: str, data: bytes) -> np.ndarray:
    """The triangles of a file by its name's ending, (triangle, corner, axis). Those with a coordinate that is not
    finite are left out. Raises MeshFault, also where none is left."""
    reader = READERS.get(name.rpartition(".")[2].lower())
    if reader is None:
        raise MeshFault(f"is none of {', '.join(READERS)}: convert it to one of them, as Blender and MeshLab do")
    try:
        with np.errstate(all="ignore"):
            corners = np.asarray(reader(data), float)
    except MeshFault:
        raise
    except ValueError:  # of numpy, and of int
        raise MeshFault("has words where numbers stand") from None
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    if not len(corners):
        raise MeshFault("has no triangles")
    return corners


def _stl(data: bytes) -> np.ndarray:
    """The triangles of an STL file, binary or text, [triangle, corner, 3]. Raises MeshFault."""
    count = int.from_bytes(data[80:STL_HEAD], "little") if len(data) >= STL_HEAD else -1
    if 0 <= count == (len(data) - STL_HEAD) / STL_TRIANGLE:
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners: np.ndarray = np.frombuffer(data, kind, count, STL_HEAD)["corners"]
        return corners
    if not data.lstrip()[:5].lower() == b"solid":
        raise MeshFault(f"is {len(data):,} bytes long, which no STL of {max(count, 0):,} triangles is")
    _limit(data.count(b"vertex") // 3)
    numbers = _numbers(_STL_CORNER.findall(data))
    if len(numbers) % 3:
        raise MeshFault("has a triangle without three corners")
    return numbers.reshape(-1, 3, 3)


def _obj(data: bytes) -> np.ndarray:
    """The triangles of an OBJ file, [triangle, corner, 3], faces of more corners cut into fans. Raises MeshFault."""
    _limit(sum(1 for _ in _OBJ_POINT.finditer(data)))
    written = list(_OBJ_POINT.finditer(data))
    points, starts = _numbers([point.groups() for point in written]), [point.start() for point in written]
    corners: list[int] = []
    for face in _OBJ_FACE.finditer(data):
        numbers = [int(corner.partition(b"/")[0][:_LONGEST]) for corner in face[1].split(b"#")[0].split()]
        seen = bisect_left(starts, face.start())  # a number below 0 counts back from here
        places = [number - 1 if number > 0 else seen + number for number in numbers]
        for number, place in zip(numbers, places, strict=True):
            if not 0 <= place < len(points) or number == 0:
                raise MeshFault(f"has a face with point {number}, and {len(points):,} points")
        for second, third in pairwise(places[1:]):
            corners += (places[0], second, third)
        _limit(len(corners) // 3)
    triangles_of_faces: np.ndarray = points[np.array(corners, np.int64).reshape(-1, 3)]
    return triangles_of_faces


def _numbers(words: list[Any]) -> np.ndarray:
    """Numbers in threes, of words of few letters."""
    return np.array(words, "S40").astype(float).reshape(-1, 3)


def _limit(count: int) -> None:
    if count > MOST_IN_TEXT:
        raise MeshFault(f"has more than {MOST_IN_TEXT:,} triangles or points as text: write it as binary STL")


READERS: Mapping[str, Callable[[bytes], np.ndarray]] = {"stl": _stl, "obj": _obj}
