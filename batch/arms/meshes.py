"""The meshes of an arm's links, read from their files and reduced to what a picture needs.

Points of a link are put into the cells of a grid, and each cell becomes one point (vertex clustering): the finest grid
counts that leaves few enough triangles.

The files are STL, binary and as text, OBJ and glTF. They are of others. Their numbers are taken as they are.
Materials, textures, normals and names are left out. A file that contradicts itself is refused as a whole, with the
reason in words.
"""

from __future__ import annotations

import base64
import hashlib
import re
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from batch.arms.gltf import gltf_triangles
from met.dynamics.spatial import rotation_rpy
from met.frozen import frozen
from met.host.files import read_regular
from met.plan import BASE, Mesh, Structure

MOST_IN_TEXT = 500_000
"""Largest number of triangles, and of an OBJ's points, in a file of text: each takes a kilobyte of memory as words."""

STL_HEAD, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL before its triangles, and of each triangle: a normal, three corners, two bytes."""

_LONGEST = 40  # characters of a number
_STL_CORNER = re.compile(rb"\bvertex\s+(\S{1,40})\s+(\S{1,40})\s+(\S{1,40})(?=\s)", re.IGNORECASE)
_STL_NAME = re.compile(rb"^[ \t]*(?:end)?solid\b(?![^\r\n]*\bfacet\b)[^\r\n]*", re.IGNORECASE | re.MULTILINE)
_STL_LOOP = re.compile(rb"\bouter\s+loop\b", re.IGNORECASE)
_OBJ_POINT = re.compile(rb"^[ \t]*v[ \t]+(\S{1,40})[ \t]+(\S{1,40})[ \t]+(\S{1,40})(?!\S)", re.MULTILINE)
_OBJ_ANY_POINT = re.compile(rb"^[ \t]*v[ \t]", re.MULTILINE)
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
        return np.frombuffer(data, kind, count, STL_HEAD)["corners"]
    if not data.lstrip()[:5].lower() == b"solid":
        raise MeshFault(f"is {len(data):,} bytes long, which no STL of {max(count, 0):,} triangles is")
    data = _STL_NAME.sub(b"", data)  # a name may have any words
    _limit(data.lower().count(b"vertex") // 3)
    numbers = _numbers(_STL_CORNER.findall(data))
    if len(numbers) != 3 * len(_STL_LOOP.findall(data)):
        raise MeshFault("has a triangle without three corners")
    return numbers.reshape(-1, 3, 3)


def _obj(data: bytes) -> np.ndarray:
    """The triangles of an OBJ file, [triangle, corner, 3], faces of more corners cut into fans. Raises MeshFault."""
    count = sum(1 for _ in _OBJ_ANY_POINT.finditer(data))
    _limit(count)
    written = list(_OBJ_POINT.finditer(data))
    if len(written) < count:  # faces count them
        raise MeshFault("has a point without three numbers")
    points, starts = _numbers([point.groups() for point in written]), [point.start() for point in written]
    corners: list[int] = []
    for face in _OBJ_FACE.finditer(data):
        words = face[1].partition(b"#")[0].split(None, MOST_IN_TEXT)
        _limit(len(words))
        numbers = [int(corner.partition(b"/")[0][:_LONGEST]) for corner in words]
        seen = bisect_left(starts, face.start())  # a number below 0 counts back from here
        places = [number - 1 if number > 0 else seen + number for number in numbers]
        for number, place in zip(numbers, places, strict=True):
            if not 0 <= place < len(points) or number == 0:
                raise MeshFault(f"has a face with point {number}, and {len(points):,} points")
        for second, third in pairwise(places[1:]):
            corners += (places[0], second, third)
        _limit(len(corners) // 3)
    return points[np.array(corners, np.int64).reshape(-1, 3)]


def _numbers(words: list[Any]) -> np.ndarray:
    """Numbers in threes, of words of few letters."""
    return np.array(words, "S40").astype(float).reshape(-1, 3)


def _limit(count: int) -> None:
    if count > MOST_IN_TEXT:
        raise MeshFault(f"has more than {MOST_IN_TEXT:,} triangles or points as text: write it as binary STL")


def _gltf(data: bytes) -> np.ndarray:
    """The triangles of a glTF file, text or binary, [triangle, corner, 3]. Raises MeshFault."""
    try:
        return gltf_triangles(data)
    except ValueError as fault:
        raise MeshFault(str(fault)) from None


READERS: Mapping[str, Callable[[bytes], np.ndarray]] = {"stl": _stl, "obj": _obj, "glb": _gltf, "gltf": _gltf}


MOST_READ = 4_000_000
"""Number of triangles of a link with which no more of its files are read: each takes 72 bytes before it is reduced."""

MOST_OF_LINK, MOST_OF_ARM = 3_000, 30_000
"""Largest number of triangles of a drawn link, and of all links of an arm."""

CELLS = 65_535
"""Number of cells along the longest side of the grid in which a page has a link's points, in 16 bits each."""

PAGE_BYTES = 2 * 4 / 3
"""Number of bytes that a number of a mesh takes on a page: two, as base64."""

MOST_NAMED = 6  # meshes that are not drawn
MOST_FILE_BYTES = 64 << 20
SMALLEST, FARTHEST = 1e-6, 1e6  # m: a mesh beyond these is in another unit, or broken


@frozen
class LinkMesh:
    """The mesh of a link.

    points  in the link's frame, m, (point, axis);  faces: places of their corners, (triangle, corner)
    whole   number of triangles in its files
    """

    link: str
    points: np.ndarray
    faces: np.ndarray
    whole: int


@frozen
class ArmMeshes:
    """The meshes of an arm's links; missing: link and reason, for each file that is not drawn."""

    links: tuple[LinkMesh, ...] = ()
    missing: tuple[tuple[str, str], ...] = ()

    @property
    def words(self) -> str:
        """Words on the meshes that are drawn, with their triangles, and on those that are not; "" of an arm that names
        none."""
        drawn, whole = sum(len(mesh.faces) for mesh in self.links), sum(mesh.whole for mesh in self.links)
        size = sum(mesh.points.size + mesh.faces.size for mesh in self.links) * PAGE_BYTES / 1000
        reduced = f"{drawn:,} triangles" + (f" of {whole:,}" if drawn < whole else "")
        links = f"{len(self.links)} link{'s' * (len(self.links) != 1)}"
        words = [f"meshes of {links}: {reduced}, {size:,.1f} kB"] if self.links else []
        words += [f"link {link} without its mesh: {reason}" for link, reason in self.missing[:MOST_NAMED]]
        more = len(self.missing) - MOST_NAMED
        return "; ".join([*words, *([f"{more} more without theirs"] if more > 0 else [])])


NO_MESHES = ArmMeshes()


def arm_meshes(structure: Structure, folder: Path) -> ArmMeshes:
    """The meshes of a structure's links, the base's too. folder: where files are looked for that are not where the deck
    has them from here: the archive's"""
    named = {link.name: link.meshes for link in structure.links if link.meshes}
    if structure.base_meshes:
        named.setdefault(BASE, structure.base_meshes)
    most = min(MOST_OF_LINK, MOST_OF_ARM // max(1, len(named)))
    out, missing = [], []
    for link, meshes in named.items():
        parts: list[np.ndarray] = []
        for mesh in meshes:
            try:
                if sum(len(part) for part in parts) > MOST_READ:
                    raise MeshFault(f"comes after {MOST_READ:,} triangles of the link's other meshes")
                parts.append(_placed(mesh, triangles(mesh.file, _contents(mesh, folder))))
            except MeshFault as fault:
                missing.append((link, f"{mesh.file} {fault}"))
        if parts and len((drawn := _reduced(link, np.concatenate(parts), most)).faces):
            out.append(drawn)
        elif parts:
            missing.append((link, "its triangles are too narrow to be drawn"))
    return ArmMeshes(tuple(out), tuple(missing))


def meshes_json(meshes: ArmMeshes, bodies: Sequence[str]) -> list[dict[str, Any]]:
    """The meshes as a page's script takes them: `body` by its number, and of points the least corner, the edge of the
    grid's cells, and their cells."""
    return [_json(mesh, bodies.index(mesh.link)) for mesh in meshes.links if mesh.link in bodies]


def _json(mesh: LinkMesh, body: int) -> dict[str, Any]:
    """A link's mesh as a page's script takes it. body: the link's number in the scene"""
    low = mesh.points.min(axis=0)
    edge = float((mesh.points.max(axis=0) - low).max()) / CELLS
    cells = np.rint((mesh.points - low) / edge)
    return {"body": body, "low": low.tolist(), "edge": edge, "points": _text(cells), "faces": _text(mesh.faces)}


def _text(numbers: np.ndarray) -> str:
    """Whole numbers of 16 bits as base64, little-endian."""
    return base64.b64encode(np.ascontiguousarray(numbers, "<u2").tobytes()).decode("ascii")


def _contents(mesh: Mesh, folder: Path) -> bytes:
    """The bytes of a mesh's file. Raises MeshFault where there is none with the digest that it had."""
    if not mesh.sha256:
        raise MeshFault("was not there when the deck was read")
    reason = "is not there"
    for path in (Path(mesh.file), folder / mesh.file):
        try:
            data = read_regular(path, MOST_FILE_BYTES)
        except OSError:
            continue
        if hashlib.sha256(data).hexdigest() == mesh.sha256:
            return data
        reason = "is another file than the one that the deck named"
    raise MeshFault(reason)


def _placed(mesh: Mesh, corners: np.ndarray) -> np.ndarray:
    """Triangles in the link's frame, m. Raises MeshFault where they are farther away than any arm, or have no size."""
    with np.errstate(all="ignore"):
        placed: np.ndarray = corners * mesh.scale @ np.array(rotation_rpy(*mesh.rpy), float).T + mesh.at
    if not (np.abs(placed) <= FARTHEST).all():
        raise MeshFault(f"has points beyond {FARTHEST:g} m: `scale` makes metres of its numbers")
    if not np.ptp(placed, axis=(0, 1)).max() > SMALLEST:
        raise MeshFault(f"is smaller than {SMALLEST:g} m: `scale` makes metres of its numbers")
    return placed


def _reduced(link: str, corners: np.ndarray, most: int) -> LinkMesh:
    """The mesh of triangles, reduced to at most so many."""
    low = corners.min(axis=(0, 1))
    wide = float((corners.max(axis=(0, 1)) - low).max())
    cells = float(CELLS)
    points, faces = _clustered(corners.reshape(-1, 3), np.arange(len(corners) * 3).reshape(-1, 3), low, wide / cells)
    fine, fine_faces = points, faces
    while len(faces) > most:
        cells = min(cells * 0.9, 200.0) if cells == CELLS else cells * max(0.5, min(0.95, (most / len(faces)) ** 0.5))
        points, faces = _clustered(fine, fine_faces, low, wide / cells)
    return LinkMesh(link, points, faces, len(corners))


def _clustered(points: np.ndarray, faces: np.ndarray, low: np.ndarray, edge: float) -> tuple[np.ndarray, np.ndarray]:
    """The middles of the points of each cell of a grid, and the triangles between them, each once and of three
    cells."""
    cells = ((points - low) / edge).astype(np.int64)
    _, place = np.unique(cells @ np.array([1, CELLS + 2, (CELLS + 2) ** 2]), return_inverse=True)
    count = np.bincount(place)
    middles = np.stack([np.bincount(place, points[:, axis]) / count for axis in range(3)], axis=1)
    corners = place[faces]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    corners = corners[np.sort(first)]
    used, place = np.unique(corners, return_inverse=True)
    return middles[used], place.reshape(-1, 3)
