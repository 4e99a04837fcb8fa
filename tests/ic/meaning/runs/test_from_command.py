"""Initial positions and rates that commands give, `q = command;`: held against what the engine asks at t = 0."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met.run import run
from tests.ic.small_decks import ARM, RUN, changed, check, experiment, messages

FOLLOWER = "servo drive { model = ideal; bandwidth = 20 1/s; command = position(0.4 rad); }\n"
BEGINS = changed(
    RUN,
    ("record = 100 Hz", "record = 1 kHz"),
    ("record = [q]", "initial { q = command; qd = command; } record = [q, qd, servo.command]"),
)
COURSES = (
    "0.4 rad",
    "step(start = 0.1 rad, to = 0.3 rad)",
    "step(start = 0.1 rad, to = 0.3 rad, at = 0.5 s)",
    "ramp(start = -0.2 rad, to = 0.3 rad, over = 0.7 s)",
    "ramp(start = -0.2 rad, to = 0.3 rad, begin = 0.3 s, over = 0.7 s)",
    "pulse(start = 0.1 rad, to = 0.3 rad, slope = 1 rad/s, over = 0.7 s)",
    "sine(amplitude = 0.3 rad, frequency = 0.7 Hz, offset = 0.1 rad, phase = 40 deg)",
    "chirp(amplitude = 20 deg, f0 = 0.2 Hz, f1 = 2 Hz, over = 8 s)",
    "trapezoid(start = 0.2 rad, to = 0.9 rad, max_rate = 1 rad/s, max_acceleration = 4 rad/s^2)",
    "table(times = [-1, 1] s, values = [0.2, 0.7] rad)",
    'trajectory("moves.csv")',
    'trajectory("moves.csv", interpolation = cubic, begin = 0.25 s)',
)
MOVES = "time [s], hinge [deg]\n-0.5, 10\n0.2, 25\n1, -5\n"


def follower(setpoint: str) -> str:
    return changed(FOLLOWER, ("position(0.4 rad)", setpoint))


@pytest.mark.slow
@pytest.mark.parametrize("course", COURSES)
def test_a_joint_begins_where_its_command_is_at_the_first_tick(tmp_path: Path, course: str) -> None:
    (tmp_path / "moves.csv").write_text(MOVES, encoding="utf-8")
    found = experiment(tmp_path, ARM, follower(f"position({course})"), BEGINS)
    did = run(found)
    asked = did.signals["servo.command"][0, :, 0]
    assert found.parameters["initial.hinge.q"].value == did.signals["q"][0, 0, 0]
    assert asked[0] == pytest.approx(did.signals["q"][0, 0, 0], rel=4e-16)  # a kernel rounds a product and a sum once
    # the difference over a tick, 1 ms, misses the slope by half a tick of the acceleration, of 7 rad/s^2 at most here
    assert found.parameters["initial.hinge.qd"].value == pytest.approx((asked[1] - asked[0]) * 1e3, abs=4e-3)


def test_an_unwritten_rate_is_zero_and_one_joint_may_be_taken_alone(tmp_path: Path) -> None:
    alone = changed(BEGINS, ("q = command; qd = command;", "hinge.q = command;"))
    found = experiment(tmp_path, ARM, follower("position(ramp(start = 0.1 rad, to = 1 rad, over = 1 s))"), alone)
    assert [found.parameters[f"initial.hinge.{name}"].value for name in ("q", "qd")] == [0.1, 0.0]


def test_a_rate_command_says_how_fast_the_joint_begins(tmp_path: Path) -> None:
    begins = changed(BEGINS, ("q = command; ", ""))
    found = experiment(
        tmp_path, ARM, follower("rate(sine(amplitude = 0.2 rad/s, frequency = 1 Hz, phase = 90 deg))"), begins
    )
    assert found.parameters["initial.hinge.qd"].value == 0.2


def test_what_a_sweep_varies_of_the_command_moves_the_beginning_of_each_case(tmp_path: Path) -> None:
    sweep = (
        "let low = 0.1 rad;\nsweep all of hold { vary low = [0.1, 0.3] rad; vary drive.command.over = [0.5, 2] s; }\n"
    )
    servo = follower("position(ramp(start = low, to = 1 rad, over = 1 s))")
    found = experiment(tmp_path, ARM, servo, BEGINS, sweep, select=["all"])
    did = run(found)
    assert did.signals["q"][:, 0, 0].tolist() == [0.1, 0.1, 0.3, 0.3]
    assert np.array_equal(did.signals["qd"][:, 0, 0], [0.9 / 0.5, 0.9 / 2.0, (1 - 0.3) / 0.5, (1 - 0.3) / 2.0])


def test_a_sweep_over_commands_and_with_take_what_is_there_then(tmp_path: Path) -> None:
    servo = follower("position(ramp(start = 0.1 rad, to = 1 rad, over = 1 s))")
    sweep = "sweep all of hold { vary hinge.servo.command = [position(0.2 rad), position(sine(amplitude = 1 rad, "
    sweep += "frequency = 1 Hz, phase = 30 deg))]; }\n"
    compiled = check(tmp_path, ARM, servo, BEGINS, sweep, select=["all"])
    assert compiled.plan is not None, messages(compiled)
    assert [run(each).signals["q"][0, 0, 0] for each in compiled.plan.experiments] == [0.2, pytest.approx(0.5)]
    with_another = BEGINS + "run other like hold { with hinge.servo.command.start = 0.7 rad; }\n"
    assert experiment(tmp_path, ARM, servo, with_another, select=["other"]).parameters["initial.hinge.q"].value == 0.7


def test_a_sweep_over_the_initial_position_itself_comes_before_the_command(tmp_path: Path) -> None:
    sweep = "sweep all of hold { vary initial.hinge.q = [0.1, 0.2] rad; }\n"
    found = experiment(tmp_path, ARM, FOLLOWER, BEGINS, sweep, select=["all"])
    assert run(found).signals["q"][:, 0, 0].tolist() == [0.1, 0.2]


def test_a_let_of_that_name_means_what_it_meant(tmp_path: Path) -> None:
    let = "let command = 0.25 rad;\n"
    found = experiment(tmp_path, let, ARM, FOLLOWER, changed(BEGINS, (" qd = command;", "")))
    assert found.parameters["initial.hinge.q"].value == 0.25


GUIDE = """\
run led like hold {
    guide all = together { hinge.to = 1 rad; max_rate = 1 rad/s; max_acceleration = 1 rad/s^2; }
    servos { hinge { command = position(all); } }
}
"""
TWO = changed(
    ARM,
    ("}\n}", "}\n    link tip { mass = 1 kg; shape = sphere(radius = 5 cm); }\n"
     "    joint slide prismatic { parent = bar; child = tip; axis = x; }\n}"),
)  # fmt: skip


@pytest.mark.parametrize(
    ("parts", "whole"),
    [
        (
            (ARM, follower("rate(0.1 rad/s)"), BEGINS),
            """\
error[D380]: `q = command` takes the position from a command, and joint `hinge` has no position command of its own
  --> deck.ic:11:19
   |
11 |     initial { q = command; qd = command; } record = [q, qd, servo.command];
   |                   ^^^^^^^
  ::: deck.ic:8:14  joint `hinge` has a rate command
   = help: write `hinge.q = 0 rad;` beside it

1 error
""",
        ),
        (
            (ARM, "servo drive { model = passive; damping = 1 N*m*s/rad; }\n", changed(RUN, ("record = [q]", "initial { hinge.qd = command; } record = [q]"))),
            """\
error[D380]: `qd = command` takes the rate from a command, and joint `hinge` has no position or rate command of its own
  --> deck.ic:11:26
   |
11 |     initial { hinge.qd = command; } record = [q];
   |                          ^^^^^^^
  ::: deck.ic:8:14  the servo of joint `hinge` takes no command
   = help: write `hinge.qd = 0 rad/s;` beside it

1 error
""",
        ),
        (
            (TWO, FOLLOWER, BEGINS),
            """\
error[D380]: `q = command` takes the position from a command, and joint `slide` has no position command of its own
  --> deck.ic:13:19
   |
13 |     initial { q = command; qd = command; } record = [q, qd, servo.command];
   |                   ^^^^^^^
  ::: deck.ic:5:5  joint `slide` has no servo
   = help: write `slide.q = 0 m;` beside it
   = help: or give `slide` a servo with such a command, in `servos`

error[D380]: `qd = command` takes the rate from a command, and joint `slide` has no position or rate command of its own
  --> deck.ic:13:33
   |
13 |     initial { q = command; qd = command; } record = [q, qd, servo.command];
   |                                 ^^^^^^^
  ::: deck.ic:5:5  joint `slide` has no servo
   = help: write `slide.qd = 0 m/s;` beside it
   = help: or give `slide` a servo with such a command, in `servos`

2 errors
""",
        ),
        (
            (ARM, FOLLOWER, changed(BEGINS, (" qd = command;", "")), GUIDE),
            """\
error[D380]: `q = command` takes the position from a command, and joint `hinge` has no position command of its own
  --> deck.ic:11:19
   |
11 |     initial { q = command; } record = [q, qd, servo.command];
   |                   ^^^^^^^
  ::: deck.ic:8:14  it follows guide `all`, which begins where the joint does
   = help: write `hinge.q = 0 rad;` beside it

1 error
""",
        ),
    ],
)  # fmt: skip
def test_a_joint_that_no_command_puts_anywhere_is_told(tmp_path: Path, parts: tuple[str, ...], whole: str) -> None:
    select = ["led"] if parts[-1] is GUIDE else None
    assert messages(check(tmp_path, *parts, select=select)) == whole


@pytest.mark.parametrize(("course", "code"), [("ramp(over = 1 s)", "D075"), ("ramp(to = 2 turn)", "D028")])
def test_a_mistake_in_the_command_is_told_once(tmp_path: Path, course: str, code: str) -> None:
    found = messages(check(tmp_path, ARM, follower(f"position({course})"), BEGINS))
    assert found.startswith(f"error[{code}]") and found.endswith("1 error\n")
