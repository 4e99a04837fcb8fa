"""Looks of links in glTF: in their places, and refused in words where trimesh would pass over something."""

from __future__ import annotations

import base64
import json
import struct
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from batch.arms.meshes import MeshFault, triangles
from tests.batch.arms.solids import box

SIDES = box((1.0, 2.0, 3.0))
Tree = dict[str, Any]


def tree(*, binary: bool = False, interleaved: bool = False) -> Tree:
    """The JSON of a file with the box, its points three for each triangle, and numbers of the points."""
    buffer: Tree = {"byteLength": len(numbers(interleaved))}
    if not binary:
        text = base64.b64encode(numbers(interleaved)).decode()
        buffer["uri"] = f"data:application/octet-stream;base64,{text}"
    points = {"buffer": 0, "byteOffset": 72, "byteLength": 36 * (24 if interleaved else 12)}
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5123, "count": 36, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": 36, "type": "VEC3"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 72},
            points | {"byteStride": 24} if interleaved else points,
        ],
        "buffers": [buffer],
    }


def numbers(interleaved: bool = False) -> bytes:
    points = SIDES.reshape(-1, 3)
    return (
        np.arange(36, dtype="<u2").tobytes()
        + np.hstack([points, points] if interleaved else [points]).astype("<f4").tobytes()
    )


def text(changed: Tree) -> bytes:
    return json.dumps(changed).encode()


def glb(changed: Tree) -> bytes:
    """The file in one piece: its JSON, then its numbers."""
    head, tail = text(changed), numbers()
    head += b" " * (-len(head) % 4)
    chunks = struct.pack("<I4s", len(head), b"JSON") + head + struct.pack("<I4s", len(tail), b"BIN\0") + tail
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("box.gltf", text(tree())),
        ("box.glb", glb(tree(binary=True))),
        ("box.gltf", text(tree(interleaved=True))),
    ],
)  # fmt: skip
def test_a_box_is_as_from_other_formats(name: str, data: bytes) -> None:
    np.testing.assert_array_equal(triangles(name, data), SIDES)


def test_nodes_are_in_their_places() -> None:
    """A quarter turn about z, doubled and shifted, of a node within another."""
    placed = tree()
    turned = {"mesh": 0, "rotation": [0, 0, 0.5**0.5, 0.5**0.5], "scale": [2, 2, 2], "translation": [1, 0, 0]}
    placed["nodes"] = [turned, {"children": [0], "translation": [0, 0, 5]}]
    placed["scenes"][0]["nodes"] = [1]
    x, y, z = np.moveaxis(SIDES, -1, 0)
    np.testing.assert_allclose(
        triangles("a.gltf", text(placed)), np.stack([1 - 2 * y, 2 * x, 2 * z + 5], -1), atol=1e-6
    )


def primitive(**entries: Any) -> Callable[[Tree], Any]:
    return lambda changed: changed["meshes"][0]["primitives"][0].update(entries)


def accessor(**entries: Any) -> Callable[[Tree], Any]:
    return lambda changed: changed["accessors"][1].update(entries)


def node(**entries: Any) -> Callable[[Tree], Any]:
    return lambda changed: changed["nodes"][0].update(entries)


def file(**entries: Any) -> Callable[[Tree], Any]:
    return lambda changed: changed.update(entries)


REFUSED = {
    "a fan": (primitive(mode=6), "has surfaces that are no triangles, or points or lines: export it as triangles"),
    "lines": (primitive(mode=1), "has surfaces that are no triangles, or points or lines: export it as triangles"),
    "an extension": (
        file(extensionsRequired=["KHR_draco_mesh_compression"]),
        "needs `KHR_draco_mesh_compression`, an extension of glTF: export it without",
    ),
    "instances": (
        file(extensionsUsed=["EXT_mesh_gpu_instancing"]),
        "has instances by `EXT_mesh_gpu_instancing`, an extension of glTF: export it without",
    ),
    "scaled numbers": (
        accessor(normalized=True),
        "has numbers that are normalized, sparse or left out: export it with plain ones",
    ),
    "sparse numbers": (
        accessor(sparse={"count": 1}),
        "has numbers that are normalized, sparse or left out: export it with plain ones",
    ),
    "a skin": (node(skin=0), "has a skin, or a node in two places: export it without"),
    "a node in itself twice": (node(children=[0, 0]), "has a skin, or a node in two places: export it without"),
    "another file": (
        file(buffers=[{"byteLength": 9, "uri": "/etc/passwd"}]),
        "has its numbers in another file: export it as one, `.glb`",
    ),
    "too many nodes": (
        file(nodes=[{"mesh": 0}] * 1_001, scenes=[{"nodes": list(range(1_001))}]),
        "has more than 1,000 nodes or 4,000,000 triangles",
    ),
    "a lying count": (accessor(count=10**12), "is no glTF that trimesh reads (ValueError)"),
    "a count that draws too much": (
        lambda changed: changed["accessors"][0].update(count=10**12),
        "has more than 1,000 nodes or 4,000,000 triangles",
    ),
    "no surfaces": (file(scenes=[{"nodes": []}]), "has no triangles"),
    "numbers that are not finite": (node(matrix=[float("nan")] * 16), "has no triangles"),
    "a mesh that is not there": (node(mesh=7), "is no glTF that trimesh reads (IndexError)"),
    "version 1": (file(asset={"version": "1.0"}), "is no glTF that trimesh reads (NotImplementedError)"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_would_be_drawn_in_part_or_wrong_is_refused(name: str) -> None:
    change, reason = REFUSED[name]
    changed = tree()
    change(changed)
    with pytest.raises(MeshFault) as fault:
        triangles("a.gltf", text(changed))
    assert str(fault.value) == reason


@pytest.mark.parametrize("data", [b"", b"[]", b"glTF", b"[" * 100_000, glb(tree(binary=True))[:-9]])
def test_what_is_no_gltf_is_refused(data: bytes) -> None:
    with pytest.raises(MeshFault, match="is no glTF that trimesh reads"):
        triangles("a.glb", data)


def test_without_trimesh_the_message_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MeshFault, match=r"`pip install 'met-arm\[gltf\]'`, or `pip install trimesh`"):
        triangles("a.glb", glb(tree(binary=True)))
