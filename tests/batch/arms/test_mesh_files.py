"""Files of meshes: the same box from each format, and files that lie, which are refused in words."""

from __future__ import annotations

import numpy as np
import pytest

from batch.arms.meshes import MeshFault, triangles
from tests.batch.arms.solids import binary_stl, box, obj, text_stl

SIDES = box((1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("box.stl", binary_stl(SIDES)),
        ("BOX.STL", text_stl(SIDES)),
        ("box.stl", text_stl(SIDES).upper()),
        ("box.stl", text_stl(SIDES).replace(b"solid box", b"solid vertex 1 2 3")),
        ("box.stl", text_stl(SIDES).replace(b"\n", b" ").replace(b"solid box", b"solid")),
        ("box.obj", obj(SIDES)),
        ("box.obj", obj(SIDES, backwards=True)),
    ],
)
def test_a_box_is_the_same_from_stl_and_obj(name: str, data: bytes) -> None:
    np.testing.assert_array_equal(triangles(name, data), SIDES)


def test_a_polygon_of_obj_is_a_fan() -> None:
    square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4 # a square\n"
    assert triangles("a.obj", square).tolist() == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]


def test_triangles_that_are_not_finite_are_left_out() -> None:
    broken = SIDES.copy()
    broken[0, 0, 0], broken[1, 2, 1] = np.nan, np.inf
    np.testing.assert_array_equal(triangles("a.stl", binary_stl(broken)), SIDES[2:])


HOSTILE = {
    "an STL of ten billion bytes by its count": ("a.stl", binary_stl(SIDES, 200_000_000)),
    "an STL with fewer triangles than bytes": ("a.stl", binary_stl(SIDES, 3)),
    "an STL that was cut off": ("a.stl", binary_stl(SIDES)[:-7]),
    "an STL of not-a-numbers": ("a.stl", binary_stl(np.full((4, 3, 3), np.nan))),
    "an empty STL": ("a.stl", b""),
    "an STL of no triangles": ("a.stl", binary_stl(SIDES[:0])),
    "an STL of text without corners": ("a.stl", b"solid nothing\n" + b"facet normal 0 0 1\n" * 9),
    "an STL of text with two corners": ("a.stl", b"solid x\nvertex 0 0 0\nvertex 1 1 1\n"),
    "an STL of words": ("a.stl", b"solid x\nvertex one two three\nvertex a b c\nvertex d e f\n"),
    "an STL with one endless word": ("a.stl", b"solid x\nvertex " + b"9" * 1_000_000),
    "an STL of text that was cut off": ("a.stl", text_stl(SIDES).rpartition(b"vertex")[0]),
    "an STL of text with a corner of two numbers": ("a.stl", text_stl(SIDES) + b"outer loop vertex 0 0"),
    "an OBJ with a point of two numbers": ("a.obj", b"v 0 0\n" + obj(SIDES)),
    "an OBJ with a point of too many letters": ("a.obj", b"v 0 0 1." + b"0" * 40 + b"e9\n" + obj(SIDES)),
    "an OBJ with a point that is not there": ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n"),
    "an OBJ with point 0": ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"),
    "an OBJ that counts back too far": ("a.obj", b"v 0 0 0\nv 1 0 0\nf -1 -2 -3\nv 0 1 0\n"),
    "an OBJ with words for points": ("a.obj", b"v a b c\nf 1 1 1\n"),
    "an OBJ with words for faces": ("a.obj", b"v 0 0 0\nf one two three\n"),
    "an OBJ without faces": ("a.obj", b"v 0 0 0\n" * 100),
    "an OBJ with a number of a million digits": ("a.obj", b"v 0 0 0\nf 1 1 " + b"9" * 1_000_000 + b"\n"),
    "an OBJ with infinite points": ("a.obj", b"v 1e999 0 0\nv 0 inf 0\nv 0 0 nan\nf 1 2 3\n"),
    "an OBJ of half a million points and one": ("a.obj", b"v 0 0 0\n" * 500_001),
    "an STL with too many corners": ("a.stl", b"solid x\n" + b"vertex 0 0 0\n" * 1_500_003),
    "an OBJ of bytes": ("a.obj", bytes(range(256)) * 99),
    "an STL of bytes": ("a.stl", bytes(range(256)) * 99),
    "a glTF of its head alone": ("a.glb", b"glTF\2\0\0\0"),
    "a format that is not read": ("a.dae", b"<COLLADA/>"),
    "a name without an ending": ("passwd", b"root:x:0:0"),
}


@pytest.mark.parametrize(("name", "data"), HOSTILE.values(), ids=HOSTILE)
def test_a_file_that_lies_is_refused_in_words(name: str, data: bytes) -> None:
    with pytest.raises(MeshFault) as refusal:
        triangles(name, data)
    words = str(refusal.value)
    assert words.split()[0] in ("is", "has") and len(words) < 120


def test_a_face_of_an_obj_has_no_more_corners_than_a_file_may() -> None:
    """Its corners become numbers only up to the limit."""
    with pytest.raises(MeshFault, match=r"^has more than 500,000 triangles or points as text"):
        triangles("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf" + b" 1" * 500_001 + b" word\n")


def test_a_refusal_says_what_is_wrong() -> None:
    with pytest.raises(MeshFault, match=r"^has a face with point 9, and 3 points$"):
        triangles("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    with pytest.raises(MeshFault, match=r"^is 684 bytes long, which no STL of 200,000,000 triangles is$"):
        triangles("a.stl", binary_stl(SIDES, 200_000_000).replace(b"solid", b"a box", 1))
    with pytest.raises(
        MeshFault, match=r"^is none of stl, obj, glb, gltf: convert it to one of them, as Blender and MeshLab do$"
    ):
        triangles("a.dae", b"")
