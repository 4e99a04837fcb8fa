"""A rate that goes up, holds and comes down: in a deck, in a run, with its mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest

from met.run import run
from tests.ic.small_decks import ARM, RUN, changed, check, experiment, messages

TURNER = """\
servo drive {
    model = ideal; bandwidth = 20 1/s;
    command = rate(pulse(to = 5 deg/s, slope = 2 deg/s^2, over = 6 s));
}
"""
LONG = changed(RUN, ("duration = 1 s", "duration = 7 s"), ("record = [q]", "record = [q, qd, servo.command]"))


def test_a_joint_goes_the_way_of_the_closed_form_and_rests(tmp_path: Path) -> None:
    did = run(experiment(tmp_path, ARM, TURNER, LONG))
    rate, slope, over = 5.0, 2.0, 6.0  # deg, s
    q, command = did.signals["q"][0, :, 0], did.signals["servo.command"][0, :, 0]
    assert command.max() == pytest.approx(rate * 0.017453292519943295, rel=1e-15) and command[-1] == command[0] == 0.0
    # the joint has at each tick the command of the tick before it, so it is a tick late, and the way is the same
    assert q[-1] == pytest.approx(rate * (over - rate / slope) * 0.017453292519943295, rel=1e-6)
    assert abs(did.signals["qd"][0, -1, 0]) < 1e-12


def test_a_case_without_the_time_is_told_with_its_figures(tmp_path: Path) -> None:
    sweep = "sweep all of hold { vary drive.command.slope = [2, 1] deg/s^2; }\n"
    found = messages(check(tmp_path, ARM, TURNER, LONG, sweep, select=["all"]))
    assert (
        found
        == """\
error[D384]: `over` of `pulse` is too short for the way up and down; case #1 breaks it
 --> deck.ic:7:66
  |
7 |     command = rate(pulse(to = 5 deg/s, slope = 2 deg/s^2, over = 6 s));
  |                                                                  ^^^ this is 6 s, and 10 s are needed
  = help: case #1: drive.command.slope = 1 deg/s^2
  = help: write a longer one, or a larger `slope`

1 error
"""
    )


def test_the_time_that_is_just_enough_is_enough(tmp_path: Path) -> None:
    just = changed(
        TURNER, ("to = 5 deg/s, slope = 2 deg/s^2, over = 6 s", "to = 0.3 rad/s, slope = 0.2 rad/s^2, over = 3 s")
    )
    assert messages(check(tmp_path, ARM, just, LONG)) == ""


def test_a_slope_of_another_dimension_is_told_with_its_units(tmp_path: Path) -> None:
    found = messages(check(tmp_path, ARM, changed(TURNER, ("2 deg/s^2", "2 deg/s")), LONG))
    assert found.startswith("error[D061]: `slope` of `pulse` is in rad/s^2, and this is in rad/s\n")


def test_a_guide_of_that_name_still_guides_and_a_value_still_is_one(tmp_path: Path) -> None:
    guide = """\
run hold {
    arm = swing;
    servos { hinge = drive { command = position(pulse); } }
    guide pulse = together { hinge.to = 1 rad; max_rate = 1 rad/s; max_acceleration = 1 rad/s^2; }
    rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    record = [q];
}
"""
    use = experiment(tmp_path, ARM, TURNER, guide).structure.servos[0]
    assert use.command is not None and use.command.guide == "pulse"
    value = changed(TURNER, ("pulse(to = 5 deg/s, slope = 2 deg/s^2, over = 6 s)", "pulse"))
    found = experiment(tmp_path, "let pulse = 0.1 rad/s;\n", ARM, value, RUN)
    assert found.parameters["hinge.servo.command.value"].value == 0.1
