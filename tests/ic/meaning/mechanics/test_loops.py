"""Loops of an arm that a deck writes wrongly: messages, and remedies that help."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from met.plan.following import followed
from tests.ic.small_decks import changed, check, experiment, messages
from tests.met.program.test_loops import BARS, CRANE

SOFTLY = "a `bushing` of the environment closes any chain softly (`met doc bushing`)"
LOOP = CRANE[CRANE.index("    loop lift") : CRANE.index("}\nservo")]


@pytest.mark.parametrize(
    ("change", "message", "helps"),
    [
        (
            ("link = rod;", "link = cylinder;"),
            "loop `lift` closes 2 moving joints: `swing`, `hinge`",
            ["between `cylinder` and `boom` it has three, and fixed ones besides", SOFTLY],
        ),
        (
            ("link = rod;", "link = boom;"),
            "loop `lift` closes 0 moving joints",
            ["between `boom` and `boom` it has three, and fixed ones besides", SOFTLY],
        ),
        (
            ("leader = stroke", "leader = strok"),
            "`strok` is no joint of loop `lift`",
            ["its joints are `stroke`, `swing`, `hinge`"],
        ),
        (
            ("leader = stroke", "leader = hinge"),
            "joint `stroke` slides, and would follow by loop `lift`",
            ["let it lead: `leader = stroke;`", SOFTLY],
        ),
        (
            ("joint swing revolute", "joint swing prismatic"),
            "joint `swing` slides, and would follow by loop `lift`",
            [SOFTLY],
        ),
        (
            ("child = cylinder;  at", "child = cylinder;  follows = hinge;  at"),
            "joint `swing` would follow twice, once by loop `lift`",
            ["leave one of the two out, or let another joint lead"],
        ),
        (("loop lift", "loop swing"), "a joint is called `swing` too", ["give the loop another name"]),
        (
            ("axis = y;", "axis = x;"),
            "loop `lift` leaves its plane",
            [
                "its revolute joints have parallel axes; a joint that slides, and the pin, stay in a plane across them",
                SOFTLY,
            ],
        ),
        (
            ("to_at = [0.9, 0, -0.1]", "to_at = [0.9, 0.02, -0.1]"),
            "loop `lift` leaves its plane",
            [
                "its revolute joints have parallel axes; a joint that slides, and the pin, stay in a plane across them",
                SOFTLY,
            ],
        ),
    ],
)
def test_a_loop_that_does_not_close_three_joints_of_a_plane_is_refused(
    tmp_path: Path, change: tuple[str, str], message: str, helps: list[str]
) -> None:
    (refusal,) = check(tmp_path, changed(CRANE, change)).diagnostics
    assert (refusal.code, refusal.message, [str(text) for text in refusal.help]) == ("D213", message, helps)


@pytest.mark.parametrize(
    ("text", "start", "far", "way"),
    [
        (CRANE, "stroke.q = 0.3 m", "stroke.q = 5 m", "from the pin to joint `swing` there are 5.6 m"),
        (changed(BARS, ("0.6, 0] m", "0.3, 0] m")), "turn.q = 20 deg", "turn.q = 180 deg", "from joint `knee` to"),
    ],
    ids=["ram", "four bars"],
)
def test_a_loop_that_is_open_where_its_leader_begins_says_where_it_closes(
    tmp_path: Path, text: str, start: str, far: str, way: str
) -> None:
    refusal = messages(check(tmp_path, changed(text, (start, far))))
    assert "does not close where its leader begins" in refusal and way in refusal
    (remedy,) = re.findall(r"it closes at `initial \{ (.*); \}`, the nearest", refusal)
    parameters = experiment(tmp_path, changed(text, (start, remedy))).parameters
    assert all(np.isfinite(quantity.value) for path, quantity in parameters.items() if path.endswith(".q"))  # type: ignore[arg-type]


def test_a_case_whose_loop_is_open_is_named(tmp_path: Path) -> None:
    sweep = "sweep places of raise { vary lift.to_at.x = [0.9, 3] m; }"
    (refusal,) = check(tmp_path, CRANE + sweep, select=["places"]).diagnostics
    assert refusal.message == "loop `lift` does not close where its leader begins; case #1 breaks it"


def test_joints_of_a_loop_have_no_reaction(tmp_path: Path) -> None:
    (refusal,) = check(tmp_path, changed(CRANE, ("record = [q,", "record = [swing.reaction.force, q,"))).diagnostics
    assert refusal.code == "D125" and [str(text) for text in refusal.help] == [
        "how the joints of loop `lift` share its load is not computed; a joint that carries the whole loop has a "
        "reaction"
    ]


def test_a_joint_that_carries_a_whole_loop_has_a_reaction(tmp_path: Path) -> None:
    stand = "link stand { mass = 9 kg;  shape = box(size = [1, 1, 1] m, along = x); }\n    link boom"
    text = changed(
        CRANE,
        ("link boom", f"{stand}"),
        ("    joint hinge revolute { parent = base;", "    joint foot revolute { parent = base;  child = stand;"
         "  axis = z; }\n    joint hinge revolute { parent = stand;"),
        ("joint swing revolute { parent = base;", "joint swing revolute { parent = stand;"),
        ("record = [q,", "record = [reaction, q,"),
    )  # fmt: skip
    recorded = experiment(tmp_path, text).structure.record
    assert [variable.joints for variable in recorded if variable.name.startswith("reaction.")] == [("foot",), ("foot",)]


def test_a_motor_is_on_the_joint_that_leads(tmp_path: Path) -> None:
    drive = "servo turner { model = ideal;  bandwidth = 9 1/s;  command = rate(0 rad/s); }\nservo drive"
    text = changed(
        CRANE, ("servo drive", drive), ("stroke = drive;", "hinge = turner;"), ("1 kHz;", "1 kHz;  servos = 1 kHz;")
    )
    assert "`hinge`" in messages(check(tmp_path, text)) and "`stroke`" in messages(check(tmp_path, text))


def test_a_joint_that_follows_in_one_loop_leads_the_next(tmp_path: Path) -> None:
    more = """link jaw { mass = 1 kg;  shape = rod(length = 0.5 m, along = x); }
    joint grip revolute { parent = boom;  child = jaw;  at = [2, 0, 0] m;  axis = y;  follows = hinge;  ratio = 2; }
    loop lift"""
    joints = {joint.name: joint for joint in experiment(tmp_path, changed(CRANE, ("loop lift", more))).structure.joints}
    assert followed("grip", joints) == ["grip", "hinge", "stroke"]
