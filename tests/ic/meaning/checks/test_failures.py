"""What failures of servos, brakes and stops would not do is told by the check: windows between ticks, two at a time."""

from __future__ import annotations

from pathlib import Path

import pytest

from met import run as engine
from met.diagnostic import Problem
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, shown


def run_with(environment: str) -> str:
    return changed(RUN, ("    duration", f"    environment {{ {environment} }}\n    duration"))


SLOW = changed(SERVO, ("ratio = 100;", "ratio = 100; rate = 500 Hz;"))


def test_a_window_that_holds_no_tick_of_the_law_is_told(tmp_path: Path) -> None:
    run = run_with("fault = runaway { joint = hinge;  from = 0.501 s;  until = 0.5015 s; }")
    assert (
        shown(tmp_path, ARM, SLOW, run)
        == """\
warning[D168]: environment `fault` never acts: the law of joint `hinge` ticks at 0.5 s and at 0.502 s, and not in between
  --> deck.ic:15:60
   |
15 |     environment { fault = runaway { joint = hinge;  from = 0.501 s;  until = 0.5015 s; } }
   |                                                            ^^^^^^^
   = help: change that, or leave it out
"""
    )


@pytest.mark.parametrize("failure", [
    "runaway { joint = hinge;  from = 0.501 s;  until = 0.5025 s; }", "runaway { joint = hinge;  until = 0.001 s; }",
    "runaway { joint = hinge;  from = 0.502 s;  until = 0.5025 s; }",
    "free_swinging { joint = hinge;  from = 0.501 s;  until = 0.5015 s; }",
])  # fmt: skip
def test_one_that_holds_a_tick_or_needs_none_is_not(failure: str, tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, SLOW, run_with(f"fault = {failure};")) == []


def test_nor_is_one_on_a_law_that_is_continuous(tmp_path: Path) -> None:
    run = changed(
        run_with("fault = runaway { joint = hinge;  from = 0.501 s;  until = 0.5015 s; }"),
        ("servos = 1 kHz", "servos = continuous"),
    )
    assert codes(tmp_path, ARM, SERVO, run) == []


def test_of_two_that_run_away_at_a_time_the_one_that_does_nothing_is_told(tmp_path: Path) -> None:
    run = run_with("up = runaway { joint = hinge; }  down = runaway { joint = hinge;  level = -1;  from = 0.4 s; }")
    assert (
        shown(tmp_path, ARM, SERVO, run)
        == """\
warning[D293]: `up` does nothing from 0.4 s on: `down` acts on the same of joint `hinge` then, and stands later
  --> deck.ic:15:77
   |
15 |     environment { up = runaway { joint = hinge; }  down = runaway { joint = hinge;  level = -1;  from = 0.4 s; } }
   |                                                                             ^^^^^
  ::: deck.ic:15:19  this one
   = help: let one end before the other begins
"""
    )
    ended = changed(run, ("runaway { joint = hinge; }", "runaway { joint = hinge;  until = 0.4 s; }"))
    assert codes(tmp_path, ARM, SERVO, ended) == []


@pytest.mark.parametrize(("second", "said"), [("qd", ["D293"]), ("q", [])])
def test_of_two_sensors_that_are_dead_those_of_one_quantity_alone(second: str, said: list[str], tmp_path: Path) -> None:
    position = changed(SERVO, ("rate(0.1 rad/s)", "position(0.1 rad);  k_position = 2 1/s"))
    run = run_with(
        "one = dead_sensor { joint = hinge;  of = qd;  until = 0.5 s; }"
        f"  two = dead_sensor {{ joint = hinge;  of = {second};  from = 0.4 s; }}"
    )
    assert codes(tmp_path, ARM, position, run) == said


def test_damping_of_joints_that_slide_on_an_arm_without_any_is_told(tmp_path: Path) -> None:
    run = run_with("grease = joint_damping { sliding = 3 N*s/m; };")
    assert (
        shown(tmp_path, ARM, SERVO, run)
        == """\
warning[D168]: `sliding` of environment `grease` changes nothing: no joint of arm `swing` is prismatic
  --> deck.ic:15:54
   |
15 |     environment { grease = joint_damping { sliding = 3 N*s/m; }; }
   |                                                      ^^^^^^^
   = help: leave it out
"""
    )
    assert codes(tmp_path, ARM, SERVO, run_with("grease = joint_damping { damping = 3 N*m*s/rad; };")) == []


LOCKED = "servo drive { model = locked;  release = 0.1 s; }\n"


def test_a_brake_on_a_joint_that_is_told_its_acceleration_is_an_error_of_the_check(tmp_path: Path) -> None:
    run = run_with("stay = brake { joint = hinge;  torque = 4 N*m; }")
    assert (
        shown(tmp_path, ARM, LOCKED, run)
        == """\
error[D291]: `stay` puts friction on joint `hinge`, which servo `drive` (locked) tells its acceleration
  --> deck.ic:10:42
   |
10 |     environment { stay = brake { joint = hinge;  torque = 4 N*m; } }
   |                                          ^^^^^
  ::: deck.ic:8:14  its servo
   = help: leave it out for this joint: no friction slows down or holds what is told its acceleration
"""
    )
    ideal = "servo drive { model = ideal;  bandwidth = 5 1/s;  command = rate(0.1 rad/s); }\n"
    assert codes(tmp_path, ARM, ideal, run) == ["D291"]
    assert codes(tmp_path, ARM, SERVO, run) == codes(tmp_path, ARM, "servo drive { model = passive; }\n", run) == []


def test_a_plan_by_hand_that_has_one_still_stops_before_it_runs(tmp_path: Path) -> None:
    from dataclasses import replace

    run = experiment(
        tmp_path,
        ARM,
        "servo drive { model = passive; }\n",
        run_with("stay = brake { joint = hinge;  torque = 4 N*m; }"),
    )
    lock = experiment(tmp_path, ARM, LOCKED, RUN)
    with pytest.raises(Problem) as caught:
        engine.run(
            replace(
                run,
                structure=replace(run.structure, servos=lock.structure.servos),
                parameters={**run.parameters, **lock.parameters},
            )
        )
    assert caught.value.diagnostics[0].code == "E219"


CASCADE = """\
servo drive {
    model = cascade;  gear = rigid;  ratio = 100;  kp = 0.05 A*s/rad;  ki = 0.5 A/rad;  resistance = 1 ohm;
    kt = 0.05 N*m/A;  j_m = 1e-4 kg*m^2;  inductance = 10 mH;  ki_current = 100 V/(A*s);
    command = rate(0.1 rad/s);
}
"""


def test_a_drive_that_would_run_away_without_a_limit_is_an_error(tmp_path: Path) -> None:
    run = run_with("fault = runaway { joint = hinge; }")
    assert (
        shown(tmp_path, ARM, CASCADE, run)
        == """\
error[D292]: `fault` would drive joint `hinge` with all that servo `drive` (cascade) can give, and that has no limit
  --> deck.ic:14:45
   |
14 |     environment { fault = runaway { joint = hinge; } }
   |                                             ^^^^^
  ::: deck.ic:12:14  its servo
   = help: write `i_max = ... A;` in the servo: largest current that the control law commands
"""
    )
    assert codes(tmp_path, ARM, changed(CASCADE, ("ki = 0.5", "i_max = 5 A;  ki = 0.5")), run) == []


def test_a_joint_that_begins_beyond_its_stop_is_told(tmp_path: Path) -> None:
    stop = "end = joint_stop { joint = hinge;  lower = -20 deg;  upper = 20 deg;  stiffness = 100 N*m/rad; };"
    run = changed(run_with(stop), ("    duration", "    initial { hinge.q = 0.5 rad; }\n    duration"))
    assert (
        shown(tmp_path, ARM, SERVO, run)
        == """\
warning[D294]: joint `hinge` begins at 0.5 rad, beyond an end of `end`: above 0.349066 rad
  --> deck.ic:16:25
   |
16 |     initial { hinge.q = 0.5 rad; }
   |                         ^^^^^^^
  ::: deck.ic:15:19  this one
   = help: the run begins with what drives it back: begin within, or move the end
"""
    )
    for within in ("20 deg", "0.349066 rad"):  # which is above 20 deg in the seventh digit
        assert codes(tmp_path, ARM, SERVO, changed(run, ("0.5 rad", within))) == []
    sweep = "sweep starts of hold { vary initial.hinge.q = [0, -30] deg; }\n"
    assert codes(tmp_path, ARM, SERVO, changed(run, ("0.5 rad", "0 rad")), sweep, select=["starts"]) == ["D294"]


def test_a_joint_that_begins_outside_of_its_range_is_told(tmp_path: Path) -> None:
    """What was found: it was said only after the run."""
    arm = changed(ARM, ("axis = z;", "axis = z; q_min = -1 rad; q_max = 1 rad;"))
    begins = changed(RUN, ("duration", "initial { hinge.q = 2 rad; }\n    duration"))
    led, found = check(tmp_path, arm, SERVO, begins).diagnostics
    assert (found.code, led.code) == ("D294", "D297")  # its rate leads it further
    assert found.message == "joint `hinge` begins at 2 rad, beyond its range: above 1 rad"
    assert codes(tmp_path, arm, SERVO, changed(begins, ("2 rad", "0.9 rad"))) == []


@pytest.mark.parametrize("failure", ["runaway { joint = finger; }", "dead_sensor { joint = finger;  of = qd; }"])
def test_of_a_follower_without_a_law_the_joint_that_leads_it_is_named(failure: str, tmp_path: Path) -> None:
    arm = changed(
        ARM,
        ("    joint hinge", "    link tip { mass = 1 kg; inertia = [1, 1, 1] kg*m^2; }\n    joint hinge"),
        ("axis = z; }\n", "axis = z; }\n    joint finger revolute { parent = bar; child = tip; axis = z; follows = hinge; }\n"),
    )  # fmt: skip
    run = changed(run_with(f"fault = {failure};"), ("hinge = drive;", "hinge = drive; finger = bearing;"))
    bearing = "servo bearing { model = passive; damping = 1 N*m*s/rad; }\n"
    told = shown(tmp_path, arm, SERVO, bearing, run)
    assert "servo `bearing` (passive) of joint `finger` has no law that `fault` could do anything to" in told
    assert told.endswith("   = help: name joint `hinge`, which leads it, or leave it out\n")
    assert codes(tmp_path, arm, SERVO, bearing, run.replace("joint = finger", "joint = hinge")) == []
    passive = run.replace("hinge = drive", "hinge = bearing")
    assert shown(tmp_path, arm, bearing, passive).endswith("   = help: leave it out\n"), "which would help neither"
