"""`met import` of models in MJCF: decks, remarks and messages; and beside MuJoCo where it is installed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ic
from ic.driver.import_robot import import_robot, import_with_remarks
from ic.robots import mjcf
from ic.robots.deck import WAYS
from ic.robots.entries import rotation, rpy_of
from ic.robots.mjcf_model import compiled_model
from met import cli, run
from met.diagnostic import Problem
from met.dynamics.recursion import solve
from met.host import interpreter
from met.plan import Experiment
from met.program.system import System
from tests.ic.robots.mjcf_models import ARM, MODELS, RECORDED, needs_mujoco, play, record, source, tetrahedron
from tests.ic.robots.two import refused
from tests.oracles.mjcf_mujoco import MjcfMujoco
from tests.oracles.worst import Worst, relative

# ruff: noqa: E501 - decks and messages are as wide as they are


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, text in MODELS.items():
        (tmp_path / f"{name}.xml").write_text(text, encoding="utf-8")
    return tmp_path


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    play(monkeypatch)


PRINTED = """\
// made by `met import arm.xml` from a file with the SHA-256 HASH...
// `base` is the file's body `world`.
// Not in this deck: 2 geom, 2 sensor, 1 connect, 1 general, 1 key, 1 light, 1 material, 1 mesh, 1 site, 1 solreflimit of joint, 1 tendon, 1 timestep of option.
deck 2;

arm pick_up {
    link stand { mass = 7 kg;  inertia = [0.07, 0.07, 0.035] kg*m^2; }
    link upper {
        mass    = 3 kg;
        com     = [0.2, 0, 0] m;
        inertia = [0.01, 0.05, 0.05, 0.001, 0, 0] kg*m^2;
    }
    link wrist_on_roll { mass = 0 kg; }
    link wrist {
        mass    = 0.6785840131753953 kg;
        com     = [0, 0, -0.02] m;
        inertia = [0.0002951840457313, 0.0034383474956479, 0.0034383474956479] kg*m^2;
    }
    link body_19 { mass = 0.024 kg;  inertia = [1.04e-05, 8e-06, 4e-06] kg*m^2; }
    link right_finger { mass = 0.024 kg;  inertia = [1.04e-05, 8e-06, 4e-06] kg*m^2; }  // `right finger` in the file

    joint stand_mount fixed { parent = base;  child = stand;  at = [0, 0, 0.3] m; }
    joint shoulder revolute {  // damping 0.5; friction 0.2; rotor 0.01
        parent = stand;  child = upper;
        at     = [0, 0, 0.15] m;
        rpy    = [0, 1.0471975511965979, 0] rad;
        axis   = y;
        q_min  = -1.5707963267948966 rad;  q_max = 1.0471975511965976 rad;  tau_max = 50 N*m;
    }
    joint roll revolute {  // continuous; damping 0.5; rotor 0.01
        parent  = upper;  child = wrist_on_roll;
        at      = [0.4866025403784439, 0, -0.049999999999999996] m;
        rpy     = [0, 0.5235987755982988, 0] rad;
        axis    = x;
        tau_max = 10 N*m;
    }
    joint yaw revolute {  // continuous; damping 0.5; stiffness 3; rest 0.3490658503988659; rotor 0.01
        parent = wrist_on_roll;  child = wrist;
        at     = [0, 0, 0.02] m;
        axis   = [0, 0.7071067811865475, 0.7071067811865475];
    }
    joint left prismatic {  // damping 0.5
        parent = wrist;  child = body_19;
        at     = [0.15, 0.02, -0.02] m;
        axis   = y;
        q_min  = 0 m;  q_max = 0.04 m;
    }
    joint right prismatic {  // damping 0.5
        parent  = wrist;  child = right_finger;
        at      = [0.15, -0.03, -0.02] m;
        axis    = y;
        follows = left;
        ratio   = -1;
    }
}

// Each joint is held, and `tau` is what that takes. Put servos of yours in the place of these.
servo held { model = ideal;  bandwidth = 20 1/s;  command = position(0 rad); }
servo held_slide like held { command = position(0 m); }

default run hold {
    arm         = pick_up;
    servos      {
        shoulder = held { command = position(-0.4 rad); };
        roll = held { command = position(0.1 rad); };
        yaw = held { command = position(0.2 rad); };
        left = held_slide { command = position(0.02 m); };
    }
    initial {  // the keyframe `home`
        shoulder.q = -0.4 rad;
        roll.q = 0.1 rad;
        yaw.q = 0.2 rad;
        left.q = 0.02 m;
    }
    environment { gravity = [0, 0, -9.8] m/s^2; }
    rates       { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration    = 1 s;
    record      = [q, tau];
}

// The joints let go, with the damping, friction, springs and rotors of the file.
servo shoulder_bearing { model = passive;  damping = 0.5 N*m*s/rad;  friction = 0.2 N*m;  rotor = 0.01 kg*m^2; }
servo roll_bearing { model = passive;  damping = 0.5 N*m*s/rad;  rotor = 0.01 kg*m^2; }
servo yaw_bearing { model = passive;  damping = 0.5 N*m*s/rad;  stiffness = 3 N*m/rad;  rest = 0.3490658503988659 rad;  rotor = 0.01 kg*m^2; }
servo left_bearing { model = passive;  damping = 0.5 N*s/m; }
servo right_bearing { model = passive;  damping = 0.5 N*s/m; }

run fall like hold {
    servos {
        shoulder = shoulder_bearing;
        roll = roll_bearing;
        yaw = yaw_bearing;
        left = left_bearing;
        right = right_bearing;
    }
}

// Actuators as springs and dampers, at the controls of the keyframe `home`, with all of `fall`. No force is limited.
servo shoulder_actuator { model = passive;  damping = 20.5 N*m*s/rad;  friction = 0.2 N*m;  stiffness = 200 N*m/rad;  rest = -0.3 rad;  rotor = 0.01 kg*m^2; }
servo roll_actuator { model = passive;  damping = 0.5 N*m*s/rad;  rotor = 0.01 kg*m^2; }
servo yaw_actuator { model = passive;  damping = 4.5 N*m*s/rad;  stiffness = 3 N*m/rad;  rest = 0.3490658503988659 rad;  rotor = 0.01 kg*m^2; }
servo left_actuator { model = passive;  damping = 4.5 N*s/m;  stiffness = 400 N/m;  rest = 0.01 m; }
servo right_actuator { model = passive;  damping = 0.5 N*s/m; }

run drive like hold {
    rates { dynamics = 10 kHz; }
    servos {
        shoulder = shoulder_actuator;
        roll = roll_actuator;
        yaw = yaw_actuator;
        left = left_actuator;
        right = right_actuator;
    }
}
"""
NOTES = """\
note: attributes not read, and not in the deck: 1 solreflimit of joint, 1 timestep of option
note: not drawn: 1 mesh not in the folders of this robot
note: not in the deck: 2 geom: mass and inertia are in the deck; a `contact` of the environment lets two links touch
note: not in the deck: 1 site: a place on a link is a link of `mass = 0 kg` on a fixed joint
note: not in the deck: 1 connect: the loop is open in the deck: a stiff `bushing` of the environment closes it, or a `loop` of the arm
note: not in the deck: 1 tendon: a cable between two points is a `spring` of the environment; joints that move together are `follows`
note: not in the deck: 1 general: a servo drives a joint, `servo NAME { model = MODEL; ... }`
note: not in the deck: 2 sensor: the run's `record` names what is recorded, and `sensor NAME = MODEL { link = LINK; ... }` measures
note: not in the deck: 1 key: a run `like hold` with another `initial` begins there
"""


@pytest.mark.usefixtures("recorded")
def test_the_deck_has_joints_inertia_start_passive_laws_and_actuators(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["import", "arm.xml"]) == 0
    out, err = capsys.readouterr()
    assert (re.sub(r"[0-9a-f]{16}\.\.\.", "HASH...", out), err) == (PRINTED, NOTES)


@pytest.mark.slow
@pytest.mark.usefixtures("recorded")
@pytest.mark.parametrize("name", MODELS)
def test_the_deck_is_laid_out_as_met_fmt_would_and_its_runs_reach_their_end(name: str) -> None:
    assert cli.main(["import", f"{name}.xml", "-o", "made.ic"]) == 0
    assert cli.main(["fmt", "--check", "made.ic"]) == 0
    checked = ic.check("made.ic")
    assert checked.plan is not None and not checked.diagnostics
    for experiment in checked.plan.experiments:
        assert (run.run(experiment).status == 0).all(), experiment.name


@pytest.mark.usefixtures("recorded")
def test_a_base_that_floats_begins_where_the_model_has_it() -> None:
    text, remarks = import_with_remarks("floating.xml")
    assert "base.position = [1, 2, 3] m;" in text and "base        = free;" in text
    assert "gravity = [0, 0, 0] m/s^2" in text
    experiment = ic.compile(text=text).experiments[0]
    assert experiment.parameters["links.base.mass"].value == 40.0
    (wall,) = remarks
    assert wall.startswith("not in the deck: 1 body: the arm does not carry it")


@needs_mujoco
@pytest.mark.slow
def test_what_holds_a_base_that_floats_is_said_not_to_be_in_the_deck(folder: Path) -> None:
    joint = '<joint name="f" type="free" damping="3" stiffness="4" frictionloss="1" armature="0.1"/>'
    bodies = f'<body>{joint} <geom size="1"/> <body> <joint/> <geom size="1"/> </body> </body>'
    (folder / "held.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>", encoding="utf-8")
    names = (
        "1 damping of a free joint, 1 friction of a free joint, 1 rotor of a free joint, 1 stiffness of a free joint"
    )
    assert import_with_remarks("held.xml")[1][0] == f"attributes not read, and not in the deck: {names}"


@pytest.mark.usefixtures("recorded")
def test_what_the_arm_does_not_carry_is_left_out_and_made_names_are_new() -> None:
    text, remarks = import_with_remarks("scene.xml")
    assert re.findall(r"^    (?:link|joint) (\w+)", text, re.MULTILINE) == [
        "a", "b_on_a_mount_", "b", "b_on_a_mount", "a_mount_", "a_mount", "a_joint", "b_on_a_mount_mount",
    ]  # fmt: skip
    assert "tau_max = 6 N*m" in text and "initial {  // the first keyframe" in text
    assert [remark.split(": ")[1] for remark in remarks] == ["2 motor", "1 body", "1 general"]


def test_names_that_are_made_differ_from_those_of_the_file_and_a_name_may_read_like_a_number() -> None:
    text = '<mujoco><worldbody><body name="body_3"><body name="nan"><joint/><body/></body></body></worldbody></mujoco>'
    assert sorted(source(text).named) == [
        ("body", "body_3"), ("body", "body_5"), ("body", "nan"), ("joint", "joint_4"),
    ]  # fmt: skip
    names = set(source(text.replace('"nan"', '"body_5"').replace("<body/>", '<body/><joint name="joint_4"/>')).named)
    assert names == {
        ("body", "body_3"), ("body", "body_5"), ("body", "body_5_"), ("joint", "joint_4_"), ("joint", "joint_4"),
    }  # fmt: skip


@pytest.mark.usefixtures("recorded")
def test_a_joint_that_follows_is_held_or_free_as_of_a_urdf_file() -> None:
    assert "joint right fixed {" in import_robot("arm.xml", "fixed")
    free = import_robot("arm.xml", "free")
    assert "follows = " not in free and "right = held_slide { command = position(-0.02 m); };" in free


def test_an_included_file_stands_where_it_is_included(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    head, _, tail = ARM.partition("  <worldbody>")
    body, end, rest = tail.partition("</worldbody>")
    (folder / "parts").mkdir()
    (folder / "parts" / "bodies.xml").write_text(f"<mujocoinclude><worldbody>{body}{end}</mujocoinclude>", "utf-8")
    play(monkeypatch)
    whole = import_robot("arm.xml")
    (folder / "arm.xml").write_text(f'{head}<include file="parts/bodies.xml"/>{rest}', encoding="utf-8")
    assert import_robot("arm.xml").partition("deck 2;")[2] == whole.partition("deck 2;")[2]
    assert ", which includes 1 more\n" in import_robot("arm.xml")
    (folder / "parts" / "body.xml").write_text('<body name="lost"> <body name="carried"/> </body>', "utf-8")
    text = source('<mujoco><worldbody><include file="parts/body.xml"/></worldbody></mujoco>').text
    assert 'name="carried"' in text and "lost" not in text  # the root of an included file is not of the model


def message(name: str = "arm.xml") -> str:
    with pytest.raises(Problem) as problem:
        import_robot(name)
    return refused(problem.value)


def answering(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    """Let these lines of Python stand for the program that asks MuJoCo."""
    command = [sys.executable, "-I", "-S", "-c", f"import os; print(); {program}"]
    monkeypatch.setattr(interpreter, "command", lambda *_: command)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("""print('{"error": ""}')""", "MJCF is read by MuJoCo, which is not here"),
        ("os._exit(3)", "MuJoCo stopped while it compiled this model, with status 3"),
        ("os.kill(os.getpid(), 11)", "MuJoCo stopped while it compiled this model, with status -11"),
        ("""print('{"error": "no such thing"}')""", "MuJoCo makes no model of this: no such thing"),
    ],
)
def test_a_model_that_is_not_compiled_is_refused_with_the_reason(
    answer: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    answering(monkeypatch, answer)
    assert message().startswith(f"error[D269]: {words}\n --> arm.xml:1:1\n")


def test_without_mujoco_the_message_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ModuleNotFoundError):
        compiled_model("<mujoco/>", {})
    answering(monkeypatch, """print('{"error": ""}')""")
    assert (
        message()
        == """\
error[D269]: MJCF is read by MuJoCo, which is not here
 --> arm.xml:1:1
  |
1 | <mujoco model="pick-up">
  | ^^^^^^^
  = help: `pip install 'met-arm[mjcf]'`, or `pip install mujoco`, into the Python that runs MET
"""
    )


def test_mujocos_words_are_told_at_the_line_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    words = "XML Error: Schema violation: unrecognized attribute: 'poz'\nElement 'geom', line 12, column 3"
    answering(monkeypatch, f"print({json.dumps({'error': words})!r})")
    assert (
        message()
        == """\
error[D269]: MuJoCo makes no model of this: XML Error: Schema violation: unrecognized attribute: 'poz' Element 'geom'
  --> arm.xml:14:7
   |
14 |       <body name="upper" pos="0 0 0.15" quat="1 0 1 0">
   |       ^^^^^
   = help: correct the file, or take out what the arm does not need
"""
    )


def test_a_model_that_takes_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mjcf, "MOST_SECONDS", 0.01)
    answering(monkeypatch, "import time; time.sleep(10)")
    assert "MuJoCo has not compiled this model after 0.01 s" in message()


def test_mjcf_in_a_deck_is_refused_with_the_command_that_converts_it() -> None:
    found = ic.check(text='arm it from urdf("arm.xml");').diagnostics[0]
    assert (found.code, found.help[0]) == ("D203", "`met import FILE -o DECK.ic` makes a deck of an MJCF file")


def test_angles_of_a_rotation_give_the_rotation_back() -> None:
    """Also where the pitch is a right angle, or close to one, where roll and yaw turn about one axis."""
    draw = np.random.default_rng(3)
    for pitch in (0.3, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-6, -np.pi / 2 + 1e-9, np.pi / 2 - 1e-12):
        R = rotation(*draw.uniform(-3, 3, 1), pitch, *draw.uniform(-3, 3, 1))
        np.testing.assert_allclose(rotation(*rpy_of(R)), R, atol=1e-15 * 4)


MESHED = """\
<mujoco>
  <compiler meshdir="shapes"/>
  <asset> <mesh name="cover" file="cover.stl"/> <mesh name="other" file="other.stl"/> </asset>
  <worldbody>
    <body name="a"> <joint/> <geom type="mesh" mesh="cover"/> </body>
    <body name="b"> <joint/> <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/> <geom type="mesh" mesh="other"/> </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.usefixtures("meshes")
def test_a_mesh_is_read_only_where_a_body_has_its_mass_from_it() -> None:
    model = source(MESHED)
    assert model.files == {"mesh0.stl": tetrahedron()}
    assert [element.attributes["name"] for element in model.lines if element.tag == "mesh"] == ["cover"]
    assert "shapes" not in model.text and "other" not in model.text


@needs_mujoco
@pytest.mark.slow
@pytest.mark.usefixtures("meshes")
def test_a_mesh_gives_its_body_the_mass_of_its_volume(folder: Path) -> None:
    (folder / "meshed.xml").write_text(MESHED, encoding="utf-8")
    mass = re.search(r"link a \{\s+mass\s+= (\S+) kg", import_robot("meshed.xml"))
    assert mass is not None and float(mass[1]) == pytest.approx(1000 * 0.1**3 / 6, rel=1e-6)  # STL has floats


WAYS_ON = """\
arm two {
    link bar  { mass = 1 kg;  shape = rod(length = 1 m, along = x); }
    link tip  { mass = 1 kg;  shape = rod(length = 1 m, along = x); }
    link side { mass = 1 kg;  shape = rod(length = 1 m, along = x); }
    link site { mass = 0 kg; }
    joint hinge revolute { parent = base;  child = bar;  axis = y; }
    joint knee revolute  { parent = bar;  child = tip;  axis = y;  at = [1, 0, 0] m; }
    joint wing revolute  { parent = base;  child = side;  axis = y;  follows = hinge;  ratio = -1;  offset = 1 rad; }
    joint mark fixed     { parent = tip;  child = site;  at = [1, 0, 0] m; }
}
servo bearing { model = passive;  damping = 1 N*m*s/rad;  stiffness = 2 N*m/rad; }
servo push { model = external;  command = torque(1 N*m); }
default run hold {
    arm         = two;
    servos      { hinge = push;  [knee, wing] = bearing; }
    environment {
        gravity   = [0, 0, -9.81] m/s^2;
        touch     = contact { link = tip;  radius = 1 cm;  normal = [0, 0, 1];  stiffness = 1e4 N/m; }
        closure   = bushing { link = tip;  to = side;  stiffness = [1e3, 1e3, 1e3] N/m; }
        cable     = spring { link = tip;  to = side;  stiffness = 10 N/m; }
        no_weight = wrench { link = bar;  force = [0, 0, 9.81] N; }
    }
    payload box { mass = 1 kg;  inertia = [0.1, 0.1, 0.1] kg*m^2;  on = site;  grapple = 1 ms;  position = [2, 0, 0] m; }
    sensor gyro = gyroscope { link = tip;  along = [0, 1, 0]; }
    rates       { dynamics = 1 kHz;  servos = 1 kHz;  record = 1 kHz; }
    duration    = 2 ms;
    record      = [q, tau];
}
run bent like hold { initial { hinge.q = 0.2 rad; } }
"""


def test_all_that_notes_name_is_in_decks() -> None:
    assert [each.message for each in ic.check(text=WAYS_ON).diagnostics if each.severity == "error"] == []
    in_notes = set(re.findall(r"\b(\w+)\b", " ".join(WAYS.values())))
    words = {"contact", "bushing", "spring", "follows", "ratio", "record", "sensor", "payload", "initial", "wrench"}
    assert words <= in_notes & set(re.findall(r"\w+", WAYS_ON))


@needs_mujoco
@pytest.mark.slow
def test_the_command_that_writes_bodies_out_makes_a_file_that_is_read(folder: Path) -> None:
    copies = '<replicate count="2" offset="1 0 0"><body name="b"><joint name="j"/><geom size="1"/></body></replicate>'
    (folder / "copies.xml").write_text(f"<mujoco><worldbody>{copies}</worldbody></mujoco>", encoding="utf-8")
    command = re.findall(r"`(python -c .*) FILE`", message("copies.xml"))[0]
    subprocess.run(["sh", "-c", f"{command} copies.xml".replace("python", sys.executable, 1)], check=True)
    assert len(re.findall("joint . revolute|joint j\\w+ revolute", import_robot("flat.xml"))) == 2


@pytest.mark.usefixtures("recorded")
def test_meshes_that_mujoco_would_draw_are_in_the_deck_by_their_frames_and_scales(meshes: None) -> None:
    """In the frame of a class, of an element `frame`, and from the joint's anchor; those of collisions are not."""
    (upper,) = ic.compile(text=import_robot("looks.xml")).experiments[0].structure.links
    assert [mesh.file.rpartition("/")[2] for mesh in upper.meshes] == ["cover.stl"] * 2
    assert [mesh.scale for mesh in upper.meshes] == [(0.001,) * 3, (2.0,) * 3]
    at, rpy = (
        [value for mesh in upper.meshes for value in vector(mesh)] for vector in (lambda m: m.at, lambda m: m.rpy)
    )
    assert at == pytest.approx([0.1, 0.0, 0.0, -0.1, 1.0, 1.0], abs=1e-15)
    assert rpy == pytest.approx([np.pi / 2, 0.0, 0.0, 0.0, 0.0, np.pi / 2], abs=1e-15)
    _, remarks = import_with_remarks("looks.xml")
    assert [remark for remark in remarks if remark.startswith("not drawn")] == [
        "not drawn: 1 mesh of another format than .stl, .obj, .glb, .gltf: convert them, as Blender and MeshLab do",
        "not drawn: 1 mesh not in the folders of this robot",
    ]


# Beside MuJoCo


@needs_mujoco
@pytest.mark.slow
def test_what_was_recorded_is_what_mujoco_makes_of_the_models() -> None:
    now, before = record(), json.loads(RECORDED.read_text(encoding="utf-8"))
    assert json.loads(json.dumps(now)) == before


@pytest.fixture
def meshes(folder: Path) -> None:
    """The mesh that MuJoCo wants, and `met import` does not."""
    (folder / "shapes").mkdir()
    (folder / "shapes" / "cover.stl").write_bytes(tetrahedron())


@needs_mujoco
@pytest.mark.slow
@pytest.mark.usefixtures("meshes")
def test_meshes_are_where_mujoco_has_them(folder: Path) -> None:
    """Corners in the world at the start: MuJoCo moves each mesh to its own axes of inertia."""
    import mujoco

    text = re.sub(r'<(mesh|geom)[^>]*"(other|lost)"[^>]*>', "", (folder / "looks.xml").read_text(encoding="utf-8"))
    (folder / "two.xml").write_text(text, encoding="utf-8")
    (upper,) = ic.compile(text=import_robot("two.xml")).experiments[0].structure.links
    model = mujoco.MjModel.from_xml_path("two.xml")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    drawn = [i for i in range(model.ngeom) if model.geom_group[i] == 2]
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    for geom, mesh in zip(drawn, upper.meshes, strict=True):
        first, count = (of[model.geom_dataid[geom]] for of in (model.mesh_vertadr, model.mesh_vertnum))
        theirs = model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        ours = (corners * mesh.scale) @ np.array(rotation(*mesh.rpy)).T + mesh.at + [0.1, 0.0, 0.0]
        gaps = np.linalg.norm(theirs[:, None] - ours[None], axis=2)
        assert gaps.min(axis=1).max() < 1e-6 and gaps.min(axis=0).max() < 1e-6  # their corners are floats of 32 bits


def fall(name: str) -> Experiment:
    """The run `fall` for one step, its joints without dry friction, each with a rate, followers let go."""
    text = re.sub(r" friction = [^;]*;", "", import_robot(f"{name}.xml", "free"))
    text = text.replace("duration    = 1 s", "duration    = 1 ms").replace("record = 100 Hz", "record = 1 kHz")
    rates = {joint.name: 0.3 + 0.1 * i for i, joint in enumerate(ic.compile(text=text).experiments[0].structure.moving)}
    slides = re.findall(r"joint (\w+) prismatic", text)
    entries = " ".join(f"{joint}.qd = {rate} {'m' if joint in slides else 'rad'}/s;" for joint, rate in rates.items())
    text += f"run thrown like fall {{ initial {{ {entries} }}  remove record;  record = [q, qd, qdd]; }}"
    return ic.compile(text=text, select=["thrown"]).experiments[0]


@needs_mujoco
@pytest.mark.slow
@pytest.mark.usefixtures("meshes")
@pytest.mark.parametrize("name", ["arm", "floating"])
def test_the_first_accelerations_of_a_run_are_mujocos(name: str) -> None:
    """With gravity, springs, dampers, armature, velocity products, and a base that floats."""
    found = run.run(fall(name)).signals
    theirs = MjcfMujoco(Path(f"{name}.xml")).start(None, found["qd"][0, 0])
    np.testing.assert_allclose(found["qdd"][0, 0], theirs, rtol=1e-12, atol=1e-12 * np.abs(theirs).max())


@needs_mujoco
@pytest.mark.slow
@pytest.mark.usefixtures("meshes")
def test_mass_matrix_bias_and_accelerations_are_mujocos() -> None:
    experiment, theirs = fall("arm"), MjcfMujoco(Path("arm.xml"))
    tree, n = System(experiment).tree(lambda _: 0.0), len(experiment.structure.moving)
    assert [joint.name for joint in experiment.structure.moving][:3] == theirs.names[:3]
    rotor = tuple(experiment.parameters[f"{j.name}.servo.rotor"].value for j in experiment.structure.moving)
    draw, none = np.random.default_rng(1), (0.0,) * n
    given, solved = (False,) * n, (True,) * n
    worst, gravity = Worst("M, bias and qdd against MuJoCo"), (0.0, 0.0, -9.8)
    for _ in range(3):
        q, qd, tau = (tuple(draw.uniform(-2.0, 2.0, n).tolist()) for _ in range(3))
        columns = [
            solve(tree, q, none, tau=none, qdd=tuple(unit), mode=given, rotor=rotor, gravity=(0.0, 0.0, 0.0)).tau
            for unit in np.eye(n).tolist()
        ]
        worst.see(relative(np.array(columns), theirs.mass_matrix(np.array(q))), "M")
        bias = solve(tree, q, qd, tau=none, qdd=none, mode=given, rotor=rotor, gravity=gravity).tau
        worst.see(relative(bias, theirs.bias(np.array(q), np.array(qd))), "bias")
        qdd = solve(tree, q, qd, tau=tau, qdd=none, mode=solved, rotor=rotor, gravity=gravity).qdd
        worst.see(relative(qdd, theirs.accelerations(*map(np.array, (q, qd, tau)))), "qdd")
    worst.below(1e-12)
