"""Meshes of an arm's links: reduced, placed, and left out with the reason where their files are not what they were."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ic
from batch.arms.drawn import drawn_arm, drawn_json
from batch.arms.meshes import MOST_OF_LINK, ArmMeshes, LinkMesh, arm_meshes, meshes_json
from met.plan import Experiment
from met.plan.file import dumps
from met.plan.keys import structure_key
from tests.batch.arms.solids import binary_stl, box

DECK = """\
arm one {{
    link bar {{ mass = 1 kg;  shape = rod(length = 1 m, along = x);{mesh} }}
    joint hinge revolute {{ parent = base;  child = bar;  axis = z; }}
}}
servo held {{ model = ideal;  bandwidth = 20 1/s;  command = position(0 rad); }}
run hold {{
    arm = one;  servos {{ hinge = held; }}
    rates {{ dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }}
    duration = 0.1 s;  record = [q];
}}
"""


def ball(rings: int) -> np.ndarray:
    """Triangles of a sphere of 1 m, (triangle, corner, axis)."""
    along, round_ = np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1)
    x, y = np.sin(along)[:, None] * np.cos(round_), np.sin(along)[:, None] * np.sin(round_)
    points = np.stack([x, y, np.broadcast_to(np.cos(along)[:, None], x.shape)], -1)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    return np.concatenate([np.stack(part, -2).reshape(-1, 3, 3) for part in ((a, d, c), (a, c, b))])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box.stl").write_bytes(binary_stl(box((1.0, 0.1, 0.2))))
    return tmp_path


def experiment(mesh: str = "") -> Experiment:
    (found,) = ic.compile(text=DECK.format(mesh=mesh)).experiments
    return found


def drawn(mesh: str) -> ArmMeshes:
    return arm_meshes(experiment(mesh).structure, Path())


def test_a_large_mesh_is_reduced_and_stays_near_its_surface(folder: Path) -> None:
    (folder / "ball.stl").write_bytes(binary_stl(ball(100)))
    (mesh,) = drawn('  mesh = "ball.stl";').links
    assert mesh.whole == 40_000 and 0.6 * MOST_OF_LINK < len(mesh.faces) <= MOST_OF_LINK
    # the cells of the grid, some 25 across, are 0.08 m wide: middles of points of a cell are nearer than half of one
    radii = np.linalg.norm(mesh.points, axis=1)
    assert radii.min() > 0.97 and radii.max() <= 1.0 + 1e-6
    corners = mesh.points[mesh.faces]
    assert not (corners[:, 0] == corners[:, 1]).all(axis=1).any()
    volume = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume == pytest.approx(4.0 / 3.0 * np.pi, rel=0.03)  # closed, and wound as it was


def test_a_small_mesh_is_as_it_was_and_in_its_place(folder: Path) -> None:
    mesh = '  mesh = placed("box.stl", at = [0, 0, 0.5] m, rpy = [0, 0, 90] deg, scale = [2, 1, 1]);'
    (bar,) = drawn(mesh).links
    x, y, z = np.moveaxis(box((2.0, 0.1, 0.2)), -1, 0)
    expected = np.unique(np.stack([-y, x, z + 0.5], -1).reshape(-1, 3).round(6) + 0.0, axis=0)
    np.testing.assert_allclose(np.unique(bar.points.round(6) + 0.0, axis=0), expected, atol=1e-6)
    assert (bar.link, bar.whole, len(bar.faces)) == ("bar", 12, 12)


def test_several_files_of_a_link_are_one_mesh(folder: Path) -> None:
    (bar,) = drawn('  mesh = ["box.stl", placed("box.stl", at = [0, 1, 0] m)];').links
    assert bar.whole == 24 and len(bar.points) == 16


def test_no_more_files_of_a_link_are_read_than_it_can_have_triangles(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("batch.arms.meshes.MOST_READ", 20)
    meshes = drawn('  mesh = ["box.stl", placed("box.stl", at = [2, 0, 0] m), placed("box.stl", at = [4, 0, 0] m)];')
    assert [mesh.whole for mesh in meshes.links] == [24]
    reason = "link bar without its mesh: box.stl comes after 20 triangles of the link's other meshes"
    assert meshes.words.endswith(f"; {reason}")


def test_a_page_has_the_points_to_a_thousandth_of_a_percent(folder: Path) -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.25], [0.3, 0.2, 0.1]])
    mesh = LinkMesh("bar", points, np.array([[0, 1, 2]]), 1)
    (told,) = meshes_json(ArmMeshes((mesh,)), ["base", "bar"])
    cells = np.frombuffer(base64.b64decode(told["points"]), "<u2").reshape(-1, 3)
    np.testing.assert_allclose(told["low"] + told["edge"] * cells, points, atol=1e-5)
    assert told["body"] == 1 and np.frombuffer(base64.b64decode(told["faces"]), "<u2").tolist() == [0, 1, 2]


def test_a_page_says_how_much_is_drawn(folder: Path) -> None:
    arm = drawn_arm(experiment('  mesh = "box.stl";'), ["hinge.q"], Path())
    data = drawn_json(arm)
    assert data["meshes"] == "meshes of 1 link: 12 triangles, 0.2 kB" and len(data["scene"]["meshes"]) == 1


def test_an_arm_without_meshes_is_drawn_by_the_same_data(folder: Path) -> None:
    plain = drawn_json(drawn_arm(experiment(), ["hinge.q"], Path()))
    assert "meshes" not in plain and "meshes" not in plain["scene"]
    assert drawn_json(drawn_arm(experiment('  mesh = "box.stl";'), ["hinge.q"], None)) == plain


def test_meshes_are_in_no_key_and_no_number(folder: Path) -> None:
    plain, meshed = experiment(), experiment('  mesh = "box.stl";')
    assert structure_key(plain.structure) == structure_key(meshed.structure)
    assert {path: p.value for path, p in plain.parameters.items()} == {
        path: p.value for path, p in meshed.parameters.items()
    }
    assert "meshes" not in dumps(ic.compile(text=DECK.format(mesh="")))


def test_a_file_that_changed_is_not_drawn(folder: Path) -> None:
    structure = experiment('  mesh = "box.stl";').structure
    (folder / "box.stl").write_bytes(binary_stl(box()))
    assert arm_meshes(structure, folder).words == (
        "link bar without its mesh: box.stl is another file than the one that the deck named"
    )


def test_a_file_that_is_gone_is_looked_for_beside_the_archive(folder: Path) -> None:
    structure = experiment('  mesh = "box.stl";').structure
    (folder / "kept").mkdir()
    (folder / "box.stl").rename(folder / "kept" / "box.stl")
    assert arm_meshes(structure, folder).words == "link bar without its mesh: box.stl is not there"
    assert len(arm_meshes(structure, folder / "kept").links) == 1
    (folder / "box.stl").write_bytes(binary_stl(box()))  # another file of the name, where the page is made
    assert len(arm_meshes(structure, folder / "kept").links) == 1


@pytest.mark.parametrize(
    ("scale", "reason"),
    [
        ("1e9", "has points beyond 1e+06 m"),
        ("1e-9", "is smaller than 1e-06 m"),
        ("1e300", "has points beyond 1e+06 m"),
    ],
)
def test_a_mesh_in_another_unit_is_not_drawn(folder: Path, scale: str, reason: str) -> None:
    meshes = drawn(f'  mesh = placed("box.stl", scale = [{scale}, {scale}, {scale}]);')
    words = f"link bar without its mesh: box.stl {reason}: `scale` makes metres of its numbers"
    assert meshes.links == () and meshes.words == words


@pytest.mark.slow
def test_all_links_of_an_arm_share_a_limit(folder: Path) -> None:
    (folder / "ball.stl").write_bytes(binary_stl(ball(40)))
    structure = experiment('  mesh = "ball.stl";').structure
    (alone,) = arm_meshes(structure, Path()).links
    crowd = replace(structure, links=tuple(replace(structure.links[0], name=f"l{n}") for n in range(12)))
    meshes = arm_meshes(crowd, Path())
    assert len(meshes.links) == 12 and sum(len(mesh.faces) for mesh in meshes.links) <= 30_000 < 12 * len(alone.faces)


@pytest.mark.parametrize("wide", [0.0, 1e-7])
def test_a_mesh_of_triangles_without_width_is_not_drawn(folder: Path, wide: float) -> None:
    (folder / "line.stl").write_bytes(binary_stl(np.array([[[0.0, 0, 0], [1, wide, 0], [1, 0, 0]]])))
    assert drawn('  mesh = "line.stl";').words == "link bar without its mesh: its triangles are too narrow to be drawn"


def test_of_many_missing_meshes_the_first_are_named(folder: Path) -> None:
    nine = ", ".join(['placed("box.stl", scale = [0, 0, 0])'] * 9)
    meshes = drawn(f"  mesh = [{nine}];")
    assert meshes.words.count("without its mesh") == 6 and meshes.words.endswith("; 3 more without theirs")
