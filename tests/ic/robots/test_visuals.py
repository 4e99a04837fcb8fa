"""Meshes that a URDF file names: found beside it or by their package, never outside of the robot's folders."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from ic.driver.import_robot import import_with_remarks
from ic.robots.files import load
from ic.robots.visuals import NO_NUMBERS, NOT_FOUND, OTHER_FORMAT, UNWRITABLE
from met import cli
from met.plan import Mesh

ROBOT = """\
<robot name="one">
  <link name="stand"> {stand} </link>
  <link name="bar">
    <inertial> <mass value="2"/> <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/> </inertial> {bar}
  </link>
  <joint name="hinge" type="revolute">
    <parent link="stand"/> <child link="bar"/> <axis xyz="0 0 1"/> <limit effort="1" velocity="1"/>
  </joint>
</robot>
"""
RUN = """
servo held { model = ideal;  bandwidth = 20 1/s;  command = position(0 rad); }
run hold {
    arm = one;  servos { hinge = held; }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 0.1 s;  record = [q];
}
"""


def visual(file: str, origin: str = "", scale: str = "") -> str:
    return f'<visual> {origin} <geometry> <mesh filename="{file}" {scale}/> </geometry> </visual>'


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a package `one`, with a mesh, in which a URDF file stands in `urdf`; and a mesh outside."""
    package = tmp_path / "ws" / "one"
    for folder in ("urdf", "meshes"):
        (package / folder).mkdir(parents=True)
    (package / "package.xml").write_text("<package/>")
    for path in (package / "meshes" / "bar.stl", tmp_path / "secret.stl"):
        path.write_bytes(b"a mesh")
    monkeypatch.chdir(package)
    return package


def robot(bar: str, stand: str = "") -> Path:
    path = Path("urdf", "one.urdf")
    path.write_text(ROBOT.format(bar=bar, stand=stand), encoding="utf-8")
    return path


def paths(bar: str) -> list[str]:
    path = robot(bar)
    links = load(str(path), path.read_text()).robot.links
    return [mesh.path for link in links for mesh in link.visuals]


def reasons(bar: str) -> list[str]:
    path = robot(bar)
    return list(load(str(path), path.read_text()).robot.unseen)


@pytest.mark.parametrize(
    "name",
    [
        "../meshes/bar.stl",
        "package://one/meshes/bar.stl",
        "package://other/meshes/bar.stl",
        "model://one/meshes/bar.stl",
    ],
)
def test_a_mesh_is_found_beside_the_file_and_in_its_package(package: Path, name: str) -> None:
    assert paths(visual(name)) == ["../meshes/bar.stl"]


def test_a_mesh_may_be_named_from_the_root_within_the_robots_folders(package: Path) -> None:
    mesh = package / "meshes" / "bar.stl"
    assert paths(visual(str(mesh))) == paths(visual(f"file://{mesh}")) == ["../meshes/bar.stl"]


def test_a_mesh_outside_of_the_robots_folders_is_not_taken(package: Path, tmp_path: Path) -> None:
    (package / "meshes" / "link.stl").symlink_to(tmp_path / "secret.stl")
    outside = ["../../../secret.stl", str(tmp_path / "secret.stl"), f"file://{tmp_path}/secret.stl"]
    for name in (*outside, "../meshes/link.stl", "package://one/meshes/link.stl", "package://../../secret.stl"):
        assert reasons(visual(name)) == [NOT_FOUND], name


@pytest.mark.parametrize(
    ("written", "reason"),
    [
        (visual("../meshes/bar.dae"), OTHER_FORMAT),
        (visual(""), OTHER_FORMAT),
        (visual("https://example.org/bar.stl"), NOT_FOUND),
        (visual("&#34;; run.stl"), UNWRITABLE),
        (visual("../meshes/bar.stl", '<origin xyz="0 0"/>'), NO_NUMBERS),
        (visual("../meshes/bar.stl", '<origin rpy="0 0 nan"/>'), NO_NUMBERS),
        (visual("../meshes/bar.stl", scale='scale="a b c"'), NO_NUMBERS),
    ],
)
def test_a_mesh_that_is_not_taken_has_a_reason(package: Path, written: str, reason: str) -> None:
    assert reasons(written) == [reason]


def test_a_visual_is_counted_as_left_out_unless_its_mesh_is_taken(package: Path) -> None:
    text = visual("../meshes/bar.stl") + visual("../meshes/gone.stl") + "<visual/>"
    path = robot(text)
    body = load(str(path), path.read_text())
    assert {what: len(elements) for what, elements in body.robot.dropped.items()} == {"visual": 2}


def test_an_imported_deck_names_meshes_from_its_own_folder(package: Path) -> None:
    mesh = visual("../meshes/bar.stl", '<origin xyz="0 0 0.1" rpy="0 -0 1.5"/>', 'scale="0.001 0.001 0.001"')
    path = robot(mesh + visual("gone.stl"), stand=visual("package://one/meshes/bar.stl"))
    placed = ", at = [0, 0, 0.1] m, rpy = [0, 0, 1.5] rad, scale = [0.001, 0.001, 0.001])"
    for deck, folder in (("urdf/one.ic", "../"), ("one.ic", ""), ("../one.ic", "one/")):
        text, remarks = import_with_remarks(str(path), beside=deck)
        assert f'placed("{folder}meshes/bar.stl"{placed};' in text
        assert f'link base {{ mass = 0 kg;  mesh = "{folder}meshes/bar.stl"; }}' in text
        assert remarks == ["not drawn: 1 mesh not in the folders of this robot"]
        Path(deck).write_text(text, encoding="utf-8")
        plan = ic.compile(deck)
        [base, bar] = plan.experiments[0].structure.links
        assert [Path(mesh.file).name for mesh in (*base.meshes, *bar.meshes)] == ["bar.stl", "bar.stl"]
        assert all(mesh.sha256 for mesh in (*base.meshes, *bar.meshes))


def test_several_meshes_of_a_link_stand_in_lines_that_are_formatted(package: Path) -> None:
    several = visual("../meshes/bar.stl") + visual("../meshes/bar.stl", '<origin xyz="0 0 1"/>')
    text, _ = import_with_remarks(str(robot(several)), beside="one.ic")
    assert '            "meshes/bar.stl",\n            placed("meshes/bar.stl", at = [0, 0, 1] m),\n' in text
    Path("one.ic").write_text(text, encoding="utf-8")
    assert cli.main(["fmt", "--check", "one.ic"]) == 0


def test_a_deck_takes_the_meshes_of_the_file_that_its_arm_is_from(package: Path) -> None:
    robot(visual("../meshes/bar.stl"), stand=visual("../meshes/bar.stl", '<origin xyz="1 2 3"/>'))
    (hold,) = ic.compile(text='arm one from urdf("urdf/one.urdf");' + RUN).experiments
    (bar,) = hold.structure.links
    (mesh,) = bar.meshes
    assert mesh.file == "meshes/bar.stl"
    assert hold.structure.base_meshes == (Mesh(mesh.file, mesh.sha256, at=(1.0, 2.0, 3.0)),)
