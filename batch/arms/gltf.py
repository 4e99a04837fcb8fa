"""The triangles of a glTF file, text or binary (`.glb`), by the package trimesh, which MET's extra `gltf` installs.

trimesh passes over what it does not know, without a word: whole surfaces, or the scale of their numbers. So a file that
holds more than it reads is refused here first, and so is one that would take too long. Source: the glTF 2.0
specification of the Khronos Group.
"""

from __future__ import annotations

import io
import json
import logging
from collections.abc import Iterator
from typing import Any

import numpy as np

MOST_NODES = 1_000
"""Largest number of nodes of a file: trimesh takes a millisecond for each."""

MOST_NUMBERS = 12_000_000
"""Largest number of corners that all nodes of a file draw, three for each triangle."""

TRIANGLES = (4, 5)
"""The modes of primitives that are lists of triangles, or strips of them."""


def gltf_triangles(data: bytes) -> np.ndarray:
    """The triangles of a glTF file in the coordinates of its scene, [triangle, corner, 3]. Raises ValueError with the
    reason in words that follow the file's name."""
    try:
        import trimesh
    except ImportError:
        install = "`pip install 'met-arm[gltf]'`, or `pip install trimesh`, into the Python that runs MET"
        raise ValueError(f"is glTF, which trimesh reads: {install}") from None
    logging.getLogger("trimesh").addHandler(logging.NullHandler())  # else it writes into what the command prints
    binary = data[:4] == b"glTF"
    try:
        tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")] if binary else data)
        reason = next(_refusals(tree), None)
        if reason is None:
            kind = "glb" if binary else "gltf"
            scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False, skip_materials=True)
            triangles: np.ndarray = scene.to_mesh().triangles
            return triangles
    except Exception as fault:  # whatever a reader meets in a file of others
        raise ValueError(f"is no glTF that trimesh reads ({type(fault).__name__})") from None
    raise ValueError(reason)


def _refusals(tree: Any) -> Iterator[str]:
    """Reasons why trimesh would not draw all that the file draws, or would take too long. tree: the file's JSON"""
    for extension in tree.get("extensionsRequired", ()):
        yield f"needs `{str(extension)[:40]}`, an extension of glTF: export it without"
    for buffer in tree.get("buffers", ()):
        if not buffer.get("uri", "data:").startswith("data:"):
            yield "has its numbers in another file: export it as one, `.glb`"
    accessors, nodes = tree.get("accessors", ()), tree.get("nodes", ())
    for accessor in accessors:
        if accessor.get("normalized") or "sparse" in accessor or "bufferView" not in accessor:
            yield "has numbers that are normalized, sparse or left out: export it with plain ones"
    primitives = [mesh["primitives"] for mesh in tree.get("meshes", ())]
    if any(primitive.get("mode", 4) not in TRIANGLES for of_mesh in primitives for primitive in of_mesh):
        yield "has surfaces that are no triangles, or points or lines: export it as triangles"
    corners = [
        sum(accessors[primitive.get("indices", primitive["attributes"]["POSITION"])]["count"] for primitive in of_mesh)
        for of_mesh in primitives
    ]
    if len(nodes) > MOST_NODES or sum(corners[node["mesh"]] for node in nodes if "mesh" in node) > MOST_NUMBERS:
        yield f"has more than {MOST_NODES:,} nodes or {MOST_NUMBERS // 3:,} triangles"
    children = [child for node in nodes for child in node.get("children", ())]
    if len(set(children)) < len(children) or any(word in node for node in nodes for word in ("skin", "weights")):
        yield "has a skin, or a node in two places: export it without"
    if "EXT_mesh_gpu_instancing" in tree.get("extensionsUsed", ()):
        yield "has instances by `EXT_mesh_gpu_instancing`, an extension of glTF: export it without"
