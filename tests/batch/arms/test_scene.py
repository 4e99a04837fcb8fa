"""Scenes: where the bodies are, by formulas that node replays as a page does, and what is drawn of them."""

from __future__ import annotations

import json
import shutil
import subprocess

import numpy as np
import pytest

import ic
from batch.arms.look import FOLDER
from batch.arms.scene import ArmScene, arm_scene, lacking, scene_json
from met.plan import Experiment
from tests.batch.arms.decks import about, compiled, deck, link_frames, random_joints

REPLAY = """
globalThis.MET = {};
const { readFileSync } = require("fs");
const asked = JSON.parse(readFileSync(0));
(0, eval)(readFileSync(asked.script, "utf8"));
const { nodes, outputs, channels } = asked.scene;
const formulas = MET.formulas.make(nodes, outputs, new Set(["time", ...channels]));
const state = formulas.begin(asked.values);
console.log(JSON.stringify(asked.instants.map((each) => Array.from(formulas.at(state, each)))));
"""


def recorded(experiment: Experiment) -> list[str]:
    return [channel for each in experiment.structure.record for channel in each.channels]


def in_node(scene: ArmScene, values: dict[str, float], instants: list[list[float]]) -> np.ndarray:
    """Outputs of the scene's formulas by instant, replayed by the page's script. instants: of each the time, then the
    channels."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node; on Debian or Ubuntu: apt-get install nodejs")
    asked = {
        "script": str(FOLDER / "formulas.js"),
        "scene": scene_json(scene),
        "values": values,
        "instants": instants,
    }
    done = subprocess.run([node, "-e", REPLAY], input=json.dumps(asked), capture_output=True, text=True, check=True)
    return np.array(json.loads(done.stdout), dtype=float)


@pytest.mark.release
@pytest.mark.node
@pytest.mark.parametrize("free", [False, True])
def test_bodies_of_random_trees_are_where_rodrigues_formula_puts_them(free: bool) -> None:
    seed = 20261126 + free
    rng = np.random.default_rng(seed)
    compared = 0
    for count in (1, 2, 3, 7, 12, 30):
        joints = random_joints(rng, count)
        experiment = compiled(deck(joints, free=free))
        scene = arm_scene(experiment, recorded(experiment))
        assert lacking(scene, recorded(experiment)) == ()
        far = float(rng.uniform(0.5, 2.0))
        instants, expected = [], []
        for _ in range(5):
            q = rng.uniform(-7, 7, count)
            base = (np.eye(3), np.zeros(3))
            moving = [float(x) for x, joint in zip(q, joints, strict=True) if joint.kind != "fixed"]
            if free:
                turn = rng.normal(size=4)
                turn /= np.linalg.norm(turn)
                angle, axis = 2.0 * np.arctan2(np.linalg.norm(turn[1:]), turn[0]), turn[1:] / np.linalg.norm(turn[1:])
                base = (about(axis, angle), rng.normal(size=3))
                moving += [*base[1], *turn]
            instants.append([0.0, *moving])
            expected.append([base, *link_frames(joints, q, far, base)])
        ends = {f"{end}:{name}": 0.0 for name in scene.joints for end in ("low", "high")}
        found = in_node(scene, {"far": far, **ends}, instants)[:, : 12 * len(scene.bodies)]
        for row, frames in zip(found, expected, strict=True):
            for body, pose in zip(scene.bodies, row.reshape(-1, 12), strict=True):
                R, p = frames[0 if body.name == "base" else 1 + int(body.name.removeprefix("link"))]
                assert np.abs(pose[:9] - R.reshape(9)).max() < 1e-12, (seed, count, body)
                assert np.abs(pose[9:] - p).max() < 1e-12 * (1.0 + np.abs(p).max()), (seed, count, body)
                compared += 12
    assert compared > 3000


@pytest.mark.node
def test_the_page_replays_what_python_replays_of_shipped_decks() -> None:
    compared = 0
    for name in ("panda.ic", "stanford_arm.ic", "shuttle_arm.ic", "ets_vii.ic", "free_flyer.ic"):
        for experiment in ic.compile(name).experiments:
            scene = arm_scene(experiment, recorded(experiment))
            if lacking(scene, recorded(experiment)):
                continue
            rng = np.random.default_rng(7)
            names = ["time", *scene.channels]
            own = [each for each in scene.formulas.inputs if each not in names]
            values = {each: float(x) for each, x in zip(own, rng.uniform(0.5, 2.0, len(own)), strict=True)}
            instants = rng.uniform(-1, 1, (4, len(names))).tolist()
            found = in_node(scene, values, instants)
            for row, instant in zip(found, instants, strict=True):
                outputs = scene.formulas.replay(values | dict(zip(names, instant, strict=True)))
                assert np.abs(row - np.array(outputs)).max() < 1e-12 * max(1.0, scene.reach), experiment.name
                compared += len(row)
    assert compared > 2000


BEAM = """\
arm beam {
    link one { mass = 1 kg; shape = box(size = [0.2, 0.1, 1] m, along = z); }
    link two { mass = 2 kg; shape = cylinder(radius = 5 cm, length = 0.5 m, along = x); }
    joint a revolute  { parent = base; child = one; axis = y; }
    joint b prismatic { parent = one; child = two; axis = x; at = [0, 0, 1] m; }
}
run it {
    arm = beam;  environment { gravity = [0, 9.81, 0] m/s^2; }
    rates { dynamics = 100 Hz; record = 100 Hz; }  duration = 10 ms;  record = [RECORD];
}
sweep sizes of it { vary links.two.shape.radius = [1, 5] cm; }
"""


def test_shapes_are_those_of_the_deck_and_of_the_case() -> None:
    experiment = compiled(BEAM.replace("RECORD", "q"))
    scene = arm_scene(experiment, recorded(experiment))
    assert [body.name for body in scene.bodies] == ["base", "one", "two"]
    assert [body.carrier for body in scene.bodies] == [-1, 0, 1]
    kinds = [(scene.bodies[each.body].name, each.kind, each.role, each.joint) for each in scene.shapes]
    assert kinds == [
        ("one", "box", "link", -1), ("one", "cylinder", "joint", 0), ("one", "line", "rail", -1),
        ("two", "cylinder", "link", -1), ("two", "box", "joint", 1),
    ]  # fmt: skip
    assert scene.reach == 1.5 and scene.up == (0.0, -1.0, 0.0) and scene.joints == ("a", "b")
    given = {"a.q": 0.3, "b.q": 0.2, "low:b": 0.0, "high:b": 0.2, "links.two.shape.radius": 0.01}
    numbers = np.array(scene.formulas.replay(given))[12 * 3 : -3].reshape(-1, 9)
    assert numbers[0].tolist() == [0, 0, 0.5, 0, 0, 1, 0.2, 0.1, 1]
    assert numbers[2][:6].tolist() == [0, 0, 1, 0.2, 0, 0]
    tip = scene.formulas.replay(given)[-3:]  # of one, turned about y, then along its x by q and 0.5 m
    c, s = np.cos(0.3), np.sin(0.3)
    assert tip == pytest.approx([0.7 * c + s, 0.0, c - 0.7 * s], abs=1e-15)
    assert numbers[3].tolist() == [0.25, 0, 0, 1, 0, 0, 0.01, 0.01, 0.5]


def test_what_is_not_recorded_is_named() -> None:
    experiment = compiled(BEAM.replace("RECORD", "b.q"))
    assert lacking(arm_scene(experiment, recorded(experiment)), recorded(experiment)) == ("a.q",)
    experiment = compiled(BEAM.replace("RECORD", "qd"))
    assert lacking(arm_scene(experiment, recorded(experiment)), recorded(experiment)) == ("q",)


CRANE = """\
arm crane {
    link boom { mass = 100 kg;  com = [1, 0, 0] m;  inertia = [1, 30, 30] kg*m^2; }
    link tube { mass = 0 kg; }
    link rod { mass = 0 kg; }
    joint hinge revolute { parent = base;  child = boom;  at = [0, 0, 1.2] m;  axis = -y; }
    joint swing revolute { parent = base;  child = tube;  axis = -y; }
    joint stroke prismatic { parent = tube;  child = rod;  at = [0.6, 0, 0] m;  axis = x; }
    loop lift { leader = stroke;  branch = right;  link = rod;  at = [0.5, 0, 0] m;
        to = boom;  to_at = [0.9, 0, 0] m; }
}
run it {
    arm = crane;  initial { stroke.q = 0.4 m; }
    rates { dynamics = 100 Hz; record = 100 Hz; }  duration = 10 ms;  record = [q];
}
sweep sizes of it { vary links.boom.mass = [100, 120] kg; }
"""


def test_links_of_a_loop_are_drawn_to_its_pin_and_meet_there() -> None:
    experiment = compiled(CRANE)
    scene = arm_scene(experiment, recorded(experiment))
    drawn_shapes = [(scene.bodies[shape.body].name, shape.kind, shape.role) for shape in scene.shapes]
    assert drawn_shapes.count(("rod", "sphere", "joint")) == 1
    swing, hinge = np.arctan2(1.2, 0.9), 0.0  # a right angle at the hinge: sides of 1.2 m, 0.9 m and 1.5 m
    inputs = {"stroke.q": 0.4, "swing.q": swing, "hinge.q": hinge, "low:stroke": 0.0, "high:stroke": 0.4}
    outputs = np.array(scene.formulas.replay(inputs))
    poses = outputs[: 12 * len(scene.bodies)].reshape(-1, 12)
    shapes = outputs[12 * len(scene.bodies) : -3].reshape(-1, 9)
    ends = {}
    for name in ("rod", "boom"):
        (number,) = (n for n, shape in enumerate(drawn_shapes) if shape == (name, "line", "link"))
        pose = poses[[body.name for body in scene.bodies].index(name)]
        ends[name] = pose[:9].reshape(3, 3) @ (shapes[number][:3] + shapes[number][3:6]) + pose[9:]
    assert ends["rod"] == pytest.approx([0.9, 0.0, 1.2], abs=1e-12)
    assert ends["boom"] == pytest.approx([0.9, 0.0, 1.2], abs=1e-12)
