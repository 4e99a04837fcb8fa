"""What acts on an arm, as pages draw it: held against the accelerations that a run records; what cannot be drawn."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.arms.drawn import ActingOnArm, NotDrawn, acting_json, acting_on
from batch.arms.look import FOLDER
from batch.arms.scene import arm_scene
from met import models
from met.plan import Experiment
from tests.batch.arms.decks import about
from tests.batch.arms.test_scene import recorded
from tests.ic.small_decks import experiment as small_deck
from tests.met.small_models import EVERY, smallest

LEVER = """\
arm lever {
    link bar { mass = 3 kg; com = [0.5, 0, 0] m; inertia = [0.1, 0.2, 0.3, 0, 0, 0] kg*m^2; }
    joint hinge revolute { parent = base; child = bar; axis = z; at = [0.2, -0.1, 0.3] m; rpy = [0, 0, 0.4] rad; }
}
run pushed {
    arm = lever;
    rates { dynamics = 200 Hz; record = 50 Hz; }
    duration = 3 s;
    initial { hinge.q = 0.3 rad; hinge.qd = 0.8 rad/s; }
    record = [q, qd, qdd];
    environment {
        shove = wrench { link = bar; force = [1, 3, 1] N; moment = [1, 0, 0.5] N*m; point = [0.7, 0.2, 0] m; from = 0.4 s; until = 1.503 s; axes = link; }
        gust  = wrench_table { link = bar; point = [1, 0, 0] m; times = [0, 0.5, 2.3] s; force_x = [0, -3, 1] N; moment_z = [1, 0, -1] N*m; }
        line  = spring { link = bar; point = [1, 0, 0.1] m; to = world; to_point = [1, 2, 0] m; stiffness = 3 N/m; damping = 1 N*s/m; length = 1 m; }
        mount = bushing { link = bar; at = [0.4, 0.1, 0] m; to_at = [0.6, 0.3, 0] m; stiffness = [2, 3, 4] N/m; damping = [1, 1, 1] N*s/m; turning = [1, 1, 1] N*m/rad; }
        stop  = joint_stop { joint = hinge; upper = 40 deg; stiffness = 50 N*m/rad; dissipation = 0.2 s/rad; }
        drag  = joint_damping { damping = 0.3 N*m*s/rad; }
        jet   = plume { link = bar; at = [0.6, 0, 0] m; rpy = [90, 0, 20] deg; width = 0.8 m; height = 0.5 m; cells = 1; sides = both;
                        nozzle = [0.8, -0.7, 0.2] m; axis = [-0.1, 1, 0]; thrust = 20 N; exponent = 8; period = 0.3 s; duty = 60 %; }
    }
}
sweep pushes of pushed { vary environment.shove.force.y = [1, 5] N; }
"""  # noqa: E501


def compiled(folder: Path, text: str, name: str) -> Experiment:
    (folder / "lever.ic").write_text(text, encoding="utf-8")
    return ic.compile(folder / "lever.ic", select=[name]).experiments[0]


def drawn(experiment: Experiment) -> ActingOnArm:
    return acting_on(experiment, arm_scene(experiment, recorded(experiment)), recorded(experiment))


@pytest.mark.slow
def test_a_lever_turns_as_all_arrows_that_are_drawn_would_turn_it(tmp_path: Path) -> None:
    experiment = compiled(tmp_path, LEVER, "pushes")
    found = drawn(experiment)
    assert found.not_drawn == () and found.jets == ("jet",)
    assert {(each.name, each.kind) for each in found.arrows} == {
        ("shove", "load"), ("gust", "load"), ("line", "load"), ("mount", "load"), ("stop", "contact"), ("drag", "load"),
        ("jet", "plume"),
    }  # fmt: skip
    batch.run(ic.compile(tmp_path / "lever.ic", select=["pushes"]), output=tmp_path / "a.h5")
    with batch.open(tmp_path / "a.h5") as data:
        time = data["time"].values
        q, qd, qdd = (data[name].values.reshape(2, len(time)) for name in ("q", "qd", "qdd"))
    inertia, hinge = 0.3 + 3.0 * 0.5**2, np.array([0.2, -0.1, 0.3])  # about the hinge's axis
    seen = {each.name: 0.0 for each in found.arrows}
    for case, force in enumerate((1.0, 5.0)):
        values = {
            "time": time,
            "hinge.q": q[case],
            "hinge.qd": qd[case],
            "environment.shove.force.y": time * 0.0 + force,
        }
        numbers = np.stack([np.broadcast_to(each, len(time)) for each in found.formulas.replay(values)], axis=-1)
        moment = np.zeros(len(time))
        for n, arrow in enumerate(found.arrows):
            at, vector = numbers[:, 6 * n : 6 * n + 3], numbers[:, 6 * n + 3 : 6 * n + 6]
            moment += (np.cross(at - hinge, vector) if arrow.unit == "N" else vector)[:, 2]
            seen[arrow.name] = max(seen[arrow.name], float(np.abs(vector).max()))
        assert moment == pytest.approx(inertia * qdd[case], rel=1e-11, abs=1e-11), force
    assert all(most > 0.1 for most in seen.values()), seen  # each model acted


def test_arrows_and_cones_are_where_the_deck_has_them(tmp_path: Path) -> None:
    found = drawn(compiled(tmp_path, LEVER, "pushes"))
    values = {"hinge.q": 0.6, "hinge.qd": 0.0, "environment.shove.force.y": 3.0}
    at = {t: np.array(found.formulas.replay({"time": t, **values})) for t in (0.1, 1.0, 0.29)}
    c, s = np.cos(1.0), np.sin(1.0)  # the joint's own turn and q
    turn, hinge = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.array([0.2, -0.1, 0.3])
    names = [(each.name, each.unit) for each in found.arrows]

    def arrow(t: float, name: str, unit: str) -> np.ndarray:
        first = 6 * names.index((name, unit))
        return at[t][first : first + 6]

    point = hinge + turn @ [0.7, 0.2, 0.0]
    assert arrow(1.0, "shove", "N") == pytest.approx([*point, *(turn @ [1.0, 3.0, 1.0])], abs=1e-14)
    assert arrow(1.0, "shove", "N*m") == pytest.approx([*point, *(turn @ [1.0, 0.0, 0.5])], abs=1e-14)
    assert np.all(arrow(0.1, "shove", "N")[3:] == 0.0)
    deep = 0.6 - np.radians(40.0)
    assert arrow(1.0, "stop", "N*m") == pytest.approx([*hinge, 0, 0, -50.0 * max(0.0, deep)], abs=1e-14)
    jet = 6 * len(names)
    for t, fires in ((0.1, 1.0), (0.29, 0.0)):
        assert at[t][jet : jet + 8] == pytest.approx([0.8, -0.7, 0.2, -0.1, 1.0, 0.0, fires, 8.0], abs=1e-15)
    tilt = turn @ about([0, 0, 1], np.radians(20.0)) @ about([1, 0, 0], np.pi / 2)
    middle, width, height = at[1.0][jet + 8 :].reshape(3, 3)
    assert middle == pytest.approx(hinge + turn @ [0.6, 0, 0], abs=1e-14)
    assert [width, height] == [
        pytest.approx(tilt @ [0.8, 0, 0], abs=1e-14),
        pytest.approx(tilt @ [0, 0.5, 0], abs=1e-14),
    ]


PARCELS = """
run handed like pushed {
    payload tool   { mass = 0.8 kg; inertia = [1, 1, 1] kg*m^2; on = bar; at = [1, 0, 0.15] m; release = 2 s; }
    payload parcel { mass = 2 kg; inertia = [1, 1, 1] kg*m^2; on = bar; grapple = 1.2 s; release = 2.5 s; position = [1.7, 2.5, 0.1] m; at = [0.9, 0, 0] m; }
    record += [payloads.tool.carried, payloads.parcel.carried, payloads.parcel.position, payloads.parcel.orientation];
}
"""  # noqa: E501


@pytest.mark.slow
def test_payloads_are_carried_while_the_run_says_so_and_what_is_not_recorded_is_named(tmp_path: Path) -> None:
    experiment = compiled(tmp_path, LEVER + PARCELS, "handed")
    found = drawn(experiment)
    assert found.not_drawn == (NotDrawn("payload", "tool", ("payloads.tool.position", "payloads.tool.orientation")),)
    assert [(each.name, each.link, each.body >= 0) for each in found.payloads] == [
        ("tool", "bar", False), ("parcel", "bar", True)
    ]  # fmt: skip
    batch.run(ic.compile(tmp_path / "lever.ic", select=["handed"]), output=tmp_path / "a.h5")
    with batch.open(tmp_path / "a.h5") as data:
        time = data["time"].values
        carried = [data[f"payloads.{name}.carried"].values.reshape(-1) for name in ("tool", "parcel")]
    first = 6 * len(found.arrows) + 17 * len(found.jets)
    stages = []
    for row, t in enumerate(time):
        numbers = found.formulas.replay({"time": t, "hinge.q": 0.0, "hinge.qd": 0.0})
        stages.append((numbers[first], numbers[first + 4]))
        assert [each == 1.0 for each in stages[-1]] == [each[row] == 1.0 for each in carried], t
    assert list(dict.fromkeys(stages)) == [(1.0, 0.0), (1.0, 1.0), (2.0, 1.0), (2.0, 2.0)]


AFLOAT = """
run afloat {
    arm = lever;  base = free;
    rates { dynamics = 100 Hz; }
    duration = 10 ms;
    environment {
        line = spring { link = bar; point = [1, 0, 0.1] m; to = ball; to_point = [0.1, 0.2, 0] m; stiffness = 3 N/m; damping = 2 N*s/m; }
    }
    payload ball { mass = 2 kg; inertia = [1, 1, 1] kg*m^2; on = bar; grapple = 1 s; position = [2, 2, 0] m; }
    record = [q, qd, links.base.position, links.base.orientation, links.base.velocity, links.base.rate,
              payloads.ball.position, payloads.ball.orientation, payloads.ball.velocity, payloads.ball.rate];
}
"""  # noqa: E501


def test_a_line_between_an_arm_that_floats_and_a_payload_in_flight_pulls_along_their_points(tmp_path: Path) -> None:
    base = "  link base { mass = 10 kg; com = [0, 0, 0] m; inertia = [1, 1, 1, 0, 0, 0] kg*m^2; }\n}\nrun pushed"
    found = drawn(compiled(tmp_path, LEVER.replace("}\nrun pushed", base) + AFLOAT, "afloat"))
    assert found.not_drawn == ()
    rng = np.random.default_rng(8)
    for _ in range(5):
        values = {name: float(x) for name, x in zip(found.channels, rng.normal(size=len(found.channels)), strict=True)}
        frames = {}
        for body in ("links.base", "payloads.ball"):
            turn = rng.normal(size=4)
            turn /= np.linalg.norm(turn)
            values |= {f"{body}.orientation.{part}": float(x) for part, x in zip("wxyz", turn, strict=True)}
            angle, axis = 2.0 * np.arctan2(np.linalg.norm(turn[1:]), turn[0]), turn[1:] / np.linalg.norm(turn[1:])
            three = [np.array([values[f"{body}.{of}.{x}"] for x in "xyz"]) for of in ("position", "velocity", "rate")]
            frames[body] = (about(axis, angle), *three)
        R, p, v, w = frames["links.base"]
        hinge = R @ [0.2, -0.1, 0.3]
        own = about([0, 0, 1], 0.4 + values["hinge.q"]) @ [1, 0, 0.1]
        end = p + hinge + R @ own
        moving = v + np.cross(w, hinge + R @ own) + R @ np.cross([0, 0, values["hinge.qd"]], own)
        R, p, v, w = frames["payloads.ball"]
        other = p + R @ [0.1, 0.2, 0]
        way, growing = other - end, v + np.cross(w, R @ [0.1, 0.2, 0]) - moving
        along = way / np.linalg.norm(way)
        pull = (3.0 * np.linalg.norm(way) + 2.0 * along @ growing) * along
        numbers = found.formulas.replay(values | {"time": 0.0})
        assert numbers[:12] == pytest.approx([*end, *pull, *other, *-pull], rel=1e-12, abs=1e-12)


def test_a_load_that_needs_what_is_not_recorded_is_not_drawn_and_says_so(tmp_path: Path) -> None:
    found = drawn(compiled(tmp_path, LEVER.replace("record = [q, qd, qdd]", "record = [q, tau]"), "pushed"))
    assert found.not_drawn == tuple(NotDrawn("load", name, ("qd",)) for name in ("line", "mount", "stop", "drag"))
    assert {each.name for each in found.arrows} == {"shove", "gust", "jet"} and found.channels == ("hinge.q",)


def test_loads_with_more_formulas_than_a_page_should_hold_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("batch.arms.drawn.MOST_NODES", 400)
    found = drawn(compiled(tmp_path, LEVER, "pushed"))
    assert found.not_drawn == (NotDrawn("load", "mount"), NotDrawn("load", "jet")) and found.jets == ()
    assert {each.name for each in found.arrows} == {"shove", "gust", "line", "stop", "drag"}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for kind, name in EVERY if kind == "environment"])
def test_every_environment_model_is_drawn_or_told_unless_it_is_no_load_or_gravitation(
    name: str, tmp_path: Path
) -> None:
    deck = small_deck(tmp_path, smallest("environment", name).put(tmp_path).deck(), select=["cases"])
    found, model = drawn(deck), models.find("environment", name)
    shown = {each.name for each in (*found.arrows, *found.not_drawn)}
    loads = model.loads is not None and model.free_fall is None and name not in ("gravity", "brake")
    assert shown == ({"used"} if loads else set())


REPLAY = """
globalThis.MET = { look: { joint: [1, 1], cube: 1, rail: 1, foot: [1, 1] }, node: () => null, number: String };
const { readFileSync } = require("fs");
const asked = JSON.parse(readFileSync(0));
asked.scripts.forEach((name) => (0, eval)(readFileSync(name, "utf8")));
const acts = MET.acting.make(asked.acting, null);
const [time, ...columns] = [asked.time, ...asked.columns].map((each) => Float64Array.from(each));
const taken = acts.take(asked.values, time, columns);
while (!taken.look());
const most = { ...taken.most };
console.log(JSON.stringify([asked.time.map((t) => Array.from(taken.at(t))), most, acts.gas(taken.at(0))]));
"""


@pytest.mark.node
def test_the_page_computes_what_python_does_and_the_longest_arrow_of_all_rows(tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node; on Debian or Ubuntu: apt-get install nodejs")
    found = drawn(compiled(tmp_path, LEVER, "pushes"))
    rng = np.random.default_rng(5)
    time = np.arange(50) * 0.05
    columns = {"hinge.q": rng.uniform(-1, 1, 50), "hinge.qd": rng.uniform(-1, 1, 50)}
    asked = {
        "scripts": [str(FOLDER / name) for name in ("formulas.js", "arm.js", "acting.js")],
        "acting": acting_json(found),
        "values": {"environment.shove.force.y": 2.0},
        "time": time.tolist(),
        "columns": [columns[name].tolist() for name in found.channels],
    }
    done = subprocess.run([node, "-e", REPLAY], input=json.dumps(asked), capture_output=True, text=True, check=True)
    rows, most, (gas,) = json.loads(done.stdout)
    expected = [
        found.formulas.replay({"time": t, "environment.shove.force.y": 2.0} | {k: v[n] for k, v in columns.items()})
        for n, t in enumerate(time)
    ]
    assert np.array(rows) == pytest.approx(np.array(expected, float), rel=1e-12, abs=1e-12)
    arrows = np.array(expected, float)[:, : 6 * len(found.arrows)].reshape(len(time), -1, 6)[..., 3:]
    lengths = np.linalg.norm(arrows, axis=-1).max(axis=0)
    for key, value in most.items():
        own = [x for x, each in zip(lengths, found.arrows, strict=True) if f"{each.kind} {each.unit}" == key]
        assert value == pytest.approx(max(own), rel=1e-12)
    assert len(most) == 5 and gas["name"] == "jet" and gas["exponent"] == 8.0
