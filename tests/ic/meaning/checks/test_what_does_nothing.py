"""What a deck says and would have no effect is told: gains of zero, wrenches that never act, commands that jump."""

from __future__ import annotations

from pathlib import Path

import pytest

from met.diagnostic import Problem
from met.plan import file as plan_file
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, shown

IDEAL = "servo drive { model = ideal; bandwidth = 2 1/s; command = position(0 rad); }\n"
PUSHED = changed(RUN, ("duration", "environment { push = wrench { link = bar; force = [1, 0, 0] N; }; }\n    duration"))


def test_a_bandwidth_of_zero_never_moves_the_joint(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, changed(IDEAL, ("2 1/s", "0 1/s")), RUN)
        == """\
error[D077]: `bandwidth` of servo `drive` must be above 0 1/s under a position command
 --> deck.ic:5:42
  |
5 | servo drive { model = ideal; bandwidth = 0 1/s; command = position(0 rad); }
  |                                          ^^^^^ this is 0 1/s
  = help: write a number above 0 1/s (errors decay as exp(-bandwidth t); used only under a rate or position command)
"""
    )


def test_a_bandwidth_of_zero_in_a_sweep_names_the_case(tmp_path: Path) -> None:
    sweep = "sweep widths of hold { vary drive.bandwidth = [1, 0] 1/s; }\n"
    assert (
        shown(tmp_path, ARM, changed(IDEAL, ("position(0 rad)", "rate(1 rad/s)")), RUN, sweep)
        == """\
error[D077]: `bandwidth` of servo `drive` must be above 0 1/s under a rate command; case #1 breaks it
  --> deck.ic:13:29
   |
13 | sweep widths of hold { vary drive.bandwidth = [1, 0] 1/s; }
   |                             ^^^^^^^^^^^^^^^ this is 0 1/s
   = help: case #1: drive.bandwidth = 0 1/s
   = help: write a number above 0 1/s (errors decay as exp(-bandwidth t); used only under a rate or position command)
"""
    )


def test_under_an_acceleration_command_a_bandwidth_of_zero_is_as_good_as_any(tmp_path: Path) -> None:
    servo = changed(IDEAL, ("2 1/s", "0 1/s"), ("position(0 rad)", "acceleration(1 rad/s^2)"))
    assert codes(tmp_path, ARM, servo, RUN) == []


def test_a_plan_file_with_a_bandwidth_of_zero_is_refused(tmp_path: Path) -> None:
    plan = check(tmp_path, ARM, IDEAL, RUN).plan
    assert plan is not None
    before, head, after = plan_file.dumps(plan).partition('"hinge.servo.bandwidth":')
    (tmp_path / "p.json").write_text(before + head + after.replace("2.0", "0.0", 1), encoding="utf-8")
    with pytest.raises(Problem) as caught:
        plan_file.read(tmp_path / "p.json")
    assert "it should be above 0" in caught.value.diagnostics[0].message


@pytest.mark.parametrize(("written", "line"), [
    ("force = [1, 0, 0] N; from = 2 s; until = 1 s", "it would begin at 2 s and end at 1 s"),
    ("force = [1, 0, 0] N; from = 1 s", "it would begin at 1 s, and the run ends at 1 s"),
    ("moment = [0, 0, 0] N*m", "it has neither force nor moment"),
    ("force = [1, 0, 0] N; from = -1 s; until = 0 s", "it would end at 0 s, and the run begins at 0 s"),
])  # fmt: skip
def test_a_wrench_that_can_never_act_is_told(tmp_path: Path, written: str, line: str) -> None:
    (told,) = check(tmp_path, ARM, IDEAL, changed(PUSHED, ("force = [1, 0, 0] N", written))).diagnostics
    assert (told.code, told.severity, told.message) == ("D168", "warning", f"environment `push` never acts: {line}")


def test_the_place_of_a_wrench_that_never_acts_is_what_says_so(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, IDEAL, changed(PUSHED, ("force = [1, 0, 0] N", "force = [1, 0, 0] N; from = 5 s")))
        == """\
warning[D168]: environment `push` never acts: it would begin at 5 s, and the run ends at 1 s
  --> deck.ic:10:75
   |
10 |     environment { push = wrench { link = bar; force = [1, 0, 0] N; from = 5 s; }; }
   |                                                                           ^^^
   = help: change that, or leave it out
"""
    )


def test_a_wrench_that_acts_or_that_a_sweep_varies_is_none(tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, IDEAL, PUSHED) == []
    late = changed(PUSHED, ("force = [1, 0, 0] N", "moment = [0, 0, 1] N*m; from = 5 s"), ("[q]", "[q, tau]"))
    sweep = "sweep times of hold { vary environment.push.from = [0.5, 5] s; }\n"
    assert codes(tmp_path, ARM, IDEAL, late, sweep, select=["times"]) == []


def test_a_position_command_that_begins_elsewhere_than_its_joint(tmp_path: Path) -> None:
    run = changed(RUN, ("duration", "initial { hinge.q = 10 deg; }\n    duration"))
    assert (
        shown(tmp_path, ARM, changed(IDEAL, ("0 rad", "0.5 rad")), run)
        == """\
warning[D169]: the command of joint `hinge` begins at 0.5 rad, and the joint at 0.174533 rad: it jumps
 --> deck.ic:5:68
  |
5 | servo drive { model = ideal; bandwidth = 2 1/s; command = position(0.5 rad); }
  |                                                                    ^^^^^^^
 ::: deck.ic:10:25  the joint begins here
  = help: write `hinge.q = command;` in `initial`, or begin the command elsewhere
"""
    )


def test_where_the_two_begin_is_in_the_unit_that_the_deck_wrote(tmp_path: Path) -> None:
    said = shown(tmp_path, ARM, changed(IDEAL, ("0 rad", "30 deg")), RUN)
    assert "begins at 30 deg, and the joint at 0 deg: it jumps" in said


@pytest.mark.parametrize(("course", "jumps"), [
    ("trapezoid(start = 1 rad, to = 2 rad, max_rate = 9 rad/s, max_acceleration = 9 rad/s^2)", True),
    ("chirp(amplitude = 1 rad, f0 = 1 Hz, f1 = 2 Hz, over = 1 s, phase = 90 deg)", True),
    ("table(times = [0, 1] s, values = [1, 2] rad)", True),
    ("trapezoid(to = 2 rad, max_rate = 9 rad/s, max_acceleration = 9 rad/s^2)", False),
    ("chirp(amplitude = 1 rad, f0 = 1 Hz, f1 = 2 Hz, over = 1 s)", False),
    ("step(to = 1 rad, at = 0.5 s)", False),
    ("5e-10 rad", False),
])  # fmt: skip
def test_a_course_jumps_where_its_value_at_the_start_is_not_the_joints(
    tmp_path: Path, course: str, jumps: bool
) -> None:
    assert codes(tmp_path, ARM, changed(IDEAL, ("0 rad", course)), RUN) == ["D169"] * jumps


@pytest.mark.parametrize(
    ("asked", "begins", "jumps"),
    [
        ("30 deg", "0.523599 rad", False),  # six digits, as they are printed
        ("0.3 deg", "0.1 deg + 0.2 deg", False),
        ("720 deg", "2 cycle", False),
        ("12.5664 rad", "2 cycle", False),
        ("30 deg", "0.52361 rad", True),
        ("1.00002 rad", "1 rad", True),
        ("2e-9 rad", "0 rad", True),
    ],
)
def test_what_is_the_same_place_to_rounding_is_no_jump(tmp_path: Path, asked: str, begins: str, jumps: bool) -> None:
    run = changed(RUN, ("duration", f"initial {{ hinge.q = {begins}; }}\n    duration"))
    assert codes(tmp_path, ARM, changed(IDEAL, ("0 rad", asked)), run) == ["D169"] * jumps


@pytest.mark.parametrize(
    ("course", "jumps"),
    [
        ("trapezoid(start = 0.5 rad, to = 1 rad, max_rate = 1 rad/s, max_acceleration = 1 rad/s^2)", True),
        ("trapezoid(start = 0.01 rad, to = 1 rad, max_rate = 1 rad/s, max_acceleration = 1 rad/s^2)", False),
        ("sine(offset = 0.1 rad, amplitude = 0.1 rad, frequency = 0.1 Hz)", True),
        ("step(start = 0.5 rad, to = 1 rad, at = 0.1 s)", False),
        ("constant(value = 0.5 rad)", False),
    ],
)
def test_a_motion_that_begins_away_from_a_motor_is_told_and_a_step_is_not(
    tmp_path: Path, course: str, jumps: bool
) -> None:
    servo = changed(SERVO, ("rate(0.1 rad/s)", f"position({course})"), ("kp =", "k_position = 1 1/s; kp ="))
    found = check(tmp_path, ARM, servo, RUN).diagnostics
    assert [each.code for each in found if each.code == "D169"] == ["D169"] * jumps


def test_of_what_a_sweep_varies_and_of_a_real_servo_nothing_is_said(tmp_path: Path) -> None:
    sweep = "sweep starts of hold { vary initial.hinge.q = [0.1, 0.2] rad; }\n"
    assert codes(tmp_path, ARM, IDEAL, RUN, sweep, select=["starts"]) == []
    gearbox = (
        "servo drive { model = rigid_gearbox; ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm;"
        " kt = 0.05 N*m/A; tau_max = 1 N*m; j_m = 1e-4 kg*m^2; k_position = 5 1/s; command = position(1 rad); }\n"
    )
    assert codes(tmp_path, ARM, gearbox, RUN) == []


FIXED = """\
arm pair {
    link mast { mass = 10 kg; inertia = [2, 2, 3] kg*m^2; }
    link bar  { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    link tool { mass = 0 kg; }
    joint stand fixed { parent = base; child = mast; }
    joint hinge revolute { parent = base; child = bar; axis = z; }
    joint grip fixed { parent = bar; child = tool; at = [1, 0, 0] m; }
}
run it {
    arm = pair;
    payload box { mass = 1 kg; shape = sphere(radius = 1 cm); on = bar; }
    environment { it = MODEL; }
    rates { dynamics = 500 Hz; }  duration = 1 s;  record = [q];
}
"""
PLUME = "plume {{ link = {}; width = 1 m; height = 1 m; nozzle = [0, 0, 1] m; axis = [0, 0, -1]; thrust = 1 N; exponent = 1; {} }}"
TABLE = "wrench_table {{ link = {}; times = [0, 1, 2] s; force_x = {} N; {} }}"
STILL = "D256 environment `it` changes nothing: link `mast`, which is fixed to the base, is part of the ground"


@pytest.mark.slow
@pytest.mark.parametrize(("model", "expected"), [
    (TABLE.format("bar", "[1, 0, 0]", ""), []),
    (TABLE.format("mast", "[1, 0, 0]", ""), [STILL]),
    (TABLE.format("bar", "[0, 0, 1]", ""), ["D168 environment `it` never acts: it would begin at 1 s, and the run ends at 1 s"]),
    (TABLE.format("bar", "[0, 1, 0]", "begin = 5 s;"), ["D168 environment `it` never acts: it would begin at 5 s, and the run ends at 1 s"]),
    (TABLE.format("bar", "[1, 1, 0]", "begin = -2 s;"), ["D168 environment `it` never acts: it would end at 0 s, and the run begins at 0 s"]),
    (TABLE.format("bar", "[1, 1, 0]", "begin = -1.9 s;"), []),
    (TABLE.format("bar", "[1, 0]", ""), ["D154 `force_x` of environment `it` has 2 numbers, and `times` 3"]),
    (PLUME.format("bar", ""), []),
    (PLUME.format("mast", ""), [STILL]),
    (PLUME.format("mast", "nozzle_link = bar;"), [STILL]),
    (PLUME.format("mast", "nozzle_link = bar; reaction = on;"), []),
    (PLUME.format("bar", "share = 0;"), ["D168 environment `it` never acts: its gas has no momentum"]),
    (PLUME.format("bar", "share = 0; nozzle_link = box; reaction = on;"), []),
    ("spring { link = bar; to_point = [1, 0, 0] m; stiffness = 1 N/m; }", []),
    ("spring { link = mast; to_point = [1, 0, 0] m; stiffness = 1 N/m; }", [STILL]),
    ("spring { link = bar; to = mast; stiffness = 1 N/m; }", []),
    ("spring { link = box; to = bar; stiffness = 1 N/m; }", ["D168 environment `it` never acts: both its points are fixed to link `bar`"]),
    ("spring { link = tool; to = box; stiffness = 1 N/m; }", ["D168 environment `it` never acts: both its points are fixed to link `bar`"]),
    ("bushing { link = mast; stiffness = [1, 1, 1] N/m; }", [STILL]),
    ("bushing { link = tool; to = bar; stiffness = [1, 1, 1] N/m; }", ["D168 environment `it` never acts: both its frames are fixed to link `bar`"]),
])  # fmt: skip
def test_a_load_that_does_nothing_is_told(tmp_path: Path, model: str, expected: list[str]) -> None:
    found = check(tmp_path, FIXED.replace("MODEL", model)).diagnostics
    assert [f"{each.code} {each.message}" for each in found] == expected


def test_a_load_between_payloads_that_fly_acts(tmp_path: Path) -> None:
    flies = FIXED.replace("on = bar;", "on = bar; release = 0.5 s;")
    assert codes(tmp_path, flies.replace("MODEL", "spring { link = box; to = bar; stiffness = 1 N/m; }")) == []
