"""The meshes that a URDF file names for the looks of its links, as files beside it. They are looked at alone, so that a
fault of one is counted with its reason and costs that mesh.

`package://NAME/REST` is looked for from the file's folder upwards, no farther than one folder above its package (the
nearest folder with a `package.xml`, among the next few), or than the folder above the file's where there is none. What
is outside of these folders, by links too, is not taken: the file is of others.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping
from urllib.parse import unquote

from ic.robots.robot import Visual
from ic.robots.xml import Element
from ic.text.limits import LONGEST_STRING
from met.host.files import real_path

ENDINGS = (".stl", ".obj", ".glb", ".gltf")
MOST_UP = 4
"""Largest number of folders above a file's own among which its package is looked for."""

NOT_FOUND = "not in the folders of this robot"
OTHER_FORMAT = f"of another format than {', '.join(ENDINGS)}: convert them, as Blender and MeshLab do"
UNWRITABLE = "with a name that no deck can have"
NO_NUMBERS = "placed by what are no three numbers"

_SCHEME = re.compile(r"(package|model|file)://(.*)", re.DOTALL)


class Unseen(Exception):
    """The reason why a mesh is not taken."""


def link_visuals(
    link: Element, file: str, dropped: dict[str, list[Element]], unseen: dict[str, list[Element]]
) -> tuple[Visual, ...]:
    """The meshes of a link. Those that are taken leave `dropped`; of the others `unseen` has the elements by reason.
    file: the robot's file"""
    visuals = []
    for visual in link.all("visual"):
        for mesh in (mesh for geometry in visual.all("geometry") for mesh in geometry.all("mesh")):
            try:
                visuals.append(_visual(visual, mesh, os.path.dirname(file)))
            except Unseen as reason:
                unseen.setdefault(str(reason), []).append(mesh)
            else:
                dropped["visual"] = [other for other in dropped["visual"] if other is not visual]
    if not dropped.get("visual", True):
        del dropped["visual"]
    return tuple(visuals)


def _visual(visual: Element, mesh: Element, folder: str) -> Visual:
    """A mesh in its place. Raises Unseen."""
    origin: Mapping[str, str] = next((origin.attributes for origin in visual.all("origin")), {})
    at, rpy, scale = (
        three(attributes.get(name, default))
        for attributes, name, default in (
            (origin, "xyz", "0 0 0"),
            (origin, "rpy", "0 0 0"),
            (mesh.attributes, "scale", "1 1 1"),
        )
    )
    return Visual(beside(mesh.attributes.get("filename", "").strip(), folder), mesh.place, at, rpy, scale)


def three(text: str) -> tuple[float, float, float]:
    """Three numbers of an attribute. Raises Unseen."""
    try:
        x, y, z = (float(word) for word in text.split())
    except ValueError:
        raise Unseen(NO_NUMBERS) from None
    if not all(map(math.isfinite, (x, y, z))):
        raise Unseen(NO_NUMBERS)
    return (x + 0.0, y + 0.0, z + 0.0)  # -0 is 0


def beside(named: str, folder: str) -> str:
    """The path of a file of the robot from the folder of the robot's own. Raises Unseen."""
    if not named.lower().endswith(ENDINGS):
        raise Unseen(OTHER_FORMAT)
    if not named.isprintable() or '"' in named or "\\" in named or len(named) > LONGEST_STRING:
        raise Unseen(UNWRITABLE)
    folders = _folders(folder)
    tree = real_path(folders[-1])
    for path in _candidates(named, folder, folders):
        if os.path.isfile(path) and os.path.commonpath([tree, real_path(path)]) == tree:
            return os.path.relpath(path, folder or ".").replace(os.sep, "/")
    raise Unseen(NOT_FOUND)


def _folders(folder: str) -> list[str]:
    """The folder and those above it, up to the last one in which meshes are looked for."""
    above = [folder or "."]
    for _ in range(MOST_UP + 1):
        above.append(os.path.join(above[-1], os.pardir))
    above = [path for path in above if real_path(path) != os.sep] or above[:1]
    package = next((n for n, path in enumerate(above[:-1]) if os.path.isfile(os.path.join(path, "package.xml"))), 0)
    return above[: package + 2]


def _candidates(named: str, folder: str, folders: list[str]) -> Iterator[str]:
    """The paths that a name may mean, in order."""
    match = _SCHEME.fullmatch(named)
    if match is None or match[1] == "file":
        yield os.path.join(folder, named if match is None else unquote(match[2]))
        return
    rest = match[2]
    for path in folders:
        yield os.path.join(path, rest)
        yield os.path.join(path, rest.partition("/")[2])
