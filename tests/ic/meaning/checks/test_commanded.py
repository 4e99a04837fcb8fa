"""A command that asks a joint for more than its own limits allow is told before the run."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, messages

LIMITS = "axis = z;  q_min = -20 deg;  q_max = 1.5 rad;  qd_max = 2 rad/s;  tau_max = 30 N*m;"
LIMITED = changed(ARM, ("axis = z;", LIMITS))
MOVE = "position(trapezoid(start = 0 deg, to = 100 deg, max_rate = 2 rad/s, max_acceleration = 9 rad/s^2))"


def commanded(command: str) -> str:
    return changed(SERVO, ("rate(0.1 rad/s)", command), ("kp = 0.1", "k_position = 4 1/s; kp = 0.1"))


def test_the_value_the_instant_and_the_limit_are_told(tmp_path: Path) -> None:
    run = changed(RUN, ("duration = 1 s", "duration = 2 s"))
    assert (
        messages(check(tmp_path, LIMITED, commanded(MOVE), run)).rpartition("\n\n")[0]
        == """\
warning[D297]: `hinge.servo.command` leads to 1.74533 rad at 1.095 s, and `hinge.q_max` is 1.5 rad; a limit of a joint \
holds nothing, and is only watched
 --> deck.ic:9:42
  |
9 |     command = position(trapezoid(start = 0 deg, to = 100 deg, max_rate = 2 rad/s, max_acceleration = 9 rad/s^2));
  |                                          ^^^^^
  = help: ask for less, or move the limit
  = help: if it is meant so, `allow D297 because "...";`"""
    )
    assert codes(tmp_path, ARM, commanded(MOVE), run) == []
    assert codes(tmp_path, LIMITED, commanded(MOVE), changed(RUN, ("duration = 1 s", "duration = 0.6 s"))) == []


@pytest.mark.parametrize(
    ("beyond", "within", "said"),
    [
        ("position(-21 deg)", "position(-20 deg)", "-0.366519 rad at 0 s, and `hinge.q_min` is -0.349066 rad"),
        ("rate(1.6 rad/s)", "rate(1.5 rad/s)", "1.6 rad at 1 s, and `hinge.q_max` is 1.5 rad"),
        ("rate(sine(amplitude = -3 rad/s, frequency = 5 Hz))", "rate(sine(amplitude = -2 rad/s, frequency = 5 Hz))",
         "3 rad/s at 0.05005 s, and `hinge.qd_max` is 2 rad/s"),
        ("position(sine(amplitude = 0.3 rad, frequency = 2 Hz))", "position(sine(amplitude = 0.3 rad, frequency = 1 Hz))",
         "3.76991 rad/s at 0 s, and `hinge.qd_max` is 2 rad/s"),
        ("torque(-31 N*m)", "torque(-30 N*m)", "31 N*m at 0 s, and `hinge.tau_max` is 30 N*m"),
    ],
)  # fmt: skip
def test_each_limit(tmp_path: Path, beyond: str, within: str, said: str) -> None:
    end = f"`hinge.servo.command` leads to {said}; a limit of a joint holds nothing, and is only watched"
    assert remarks(tmp_path, commanded(beyond)) == [end]
    assert remarks(tmp_path, commanded(within)) == []


def remarks(folder: Path, *parts: str, select: str | None = None) -> list[str]:
    found = check(folder, LIMITED, parts[0], RUN, *parts[1:], select=select).diagnostics
    return [each.message for each in found if each.code == "D297" and "leads to" in each.message]


def test_in_a_sweep_the_case_is_named(tmp_path: Path) -> None:
    sweep = "sweep ways of hold { vary drive.command.value = [0, 80, 90] deg; }\n"
    assert remarks(tmp_path, commanded("position(0 deg)"), sweep, select="ways") == [
        "`hinge.servo.command` leads to 1.5708 rad at 0 s, and `hinge.q_max` is 1.5 rad in case #2; a limit of a joint "
        "holds nothing, and is only watched"
    ]
    within = changed(sweep, ("90]", "85]"))
    assert remarks(tmp_path, commanded("position(0 deg)"), within, select="ways") == []


def test_a_joint_that_begins_at_an_end_and_slides_from_zero(tmp_path: Path) -> None:
    """Ends of 0, from which a share of the position would say nothing."""
    slide = LIMITED.replace("-20 deg", "0 m").replace("1.5 rad", "2 m").replace("rad", "m").replace("N*m", "N")
    servo = "servo drive { model = ideal;  bandwidth = 5 1/s;  command = position(WHERE); }\n"
    arm = slide.replace("revolute", "prismatic")
    for where, expected in (("-0.1 m", 1), ("0 m", 0), ("2 m", 0), ("2.1 m", 1)):
        run = changed(RUN, ("duration", f"initial {{ hinge.q = {where}; }}\n    duration"))
        found = check(tmp_path, arm, servo.replace("WHERE", where), run).diagnostics
        assert [each.code for each in found].count("D297") == expected
