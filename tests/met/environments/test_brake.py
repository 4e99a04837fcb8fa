"""A brake on a joint: it holds at rest up to its torque, slows down what moves, and adds to the servo's friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.run import Run
from tests.ic.small_decks import ARM, SERVO, changed, check, experiment, messages

INERTIA = 2.0 / 3.0
RUN = """\
run it {
    arm = swing;
    servos { }
    environment {
        hold = brake { joint = hinge;  torque = 4 N*m;  from = 0.2 s;  until = 1 s; }
        push = wrench { link = bar;  moment = [0, 0, 3] N*m; }
    }
    rates { dynamics = 100 Hz;  servos = 100 Hz;  record = 100 Hz; }
    duration = 1.5 s;
    record = [q, qd, qdd, tau];
}
"""


def ran(folder: Path, *changes: tuple[str, str], before: str = "") -> Run:
    return engine.run(experiment(folder, ARM, before + changed(RUN, *changes)))


def of(run: Run, name: str) -> np.ndarray:
    return run.signals[name][0, :, 0]


@pytest.mark.slow
def test_it_stops_what_moves_holds_it_and_lets_it_go(tmp_path: Path) -> None:
    """3 N m push; from 0.2 s the brake takes 4 off, so the joint stops, and stays till 1 s."""
    run = ran(tmp_path)
    t, qd = run.time, of(run, "qd")
    fast = 3.0 / INERTIA * 0.2
    stops = 0.2 + fast / (1.0 / INERTIA)
    assert stops > 0.75
    expected = np.where(t < 0.2, 3.0 / INERTIA * t, np.where(t < stops, fast - (t - 0.2) / INERTIA, 0.0))
    expected = np.where(t >= 1.0, 3.0 / INERTIA * (t - 1.0), expected)
    np.testing.assert_allclose(qd, expected, rtol=0, atol=1e-12)
    held = (t > stops) & (t < 1.0)
    assert (qd[held] == 0.0).all() and np.ptp(of(run, "q")[held]) == 0.0
    assert run.events["splits"][0] == 1


@pytest.mark.slow
def test_it_holds_no_more_than_its_torque(tmp_path: Path) -> None:
    always = ("from = 0.2 s;  until = 1 s;", "")
    assert (of(ran(tmp_path, always), "q") == 0.0).all()
    pulled = ran(tmp_path, always, ("[0, 0, 3]", "[0, 0, 5]"))
    np.testing.assert_allclose(of(pulled, "qdd"), 1.0 / INERTIA, rtol=1e-12)


def test_it_adds_to_the_friction_of_the_joints_servo(tmp_path: Path) -> None:
    rub = "servo rub { model = passive;  friction = 2 N*m; }\n"
    run = ran(
        tmp_path,
        ("servos { }", "servos { hinge = rub; }"),
        ("[0, 0, 3]", "[0, 0, 7]"),
        ("from = 0.2 s;", ""),
        before=rub,
    )
    t = run.time
    np.testing.assert_allclose(of(run, "qdd")[t < 1.0], 1.0 / INERTIA, rtol=1e-12)
    np.testing.assert_allclose(of(run, "qdd")[t > 1.0], 5.0 / INERTIA, rtol=1e-12)


@pytest.mark.slow
def test_what_a_brake_bears_is_no_torque_of_the_servo(tmp_path: Path) -> None:
    """Held or sliding, the servo has its share of the level alone; a joint without one has none."""
    assert (of(ran(tmp_path), "tau") == 0.0).all()
    rub = "servo rub { model = passive;  friction = 2 N*m; }\n"
    run = ran(
        tmp_path,
        ("servos { }", "servos { hinge = rub; }"),
        ("from = 0.2 s;  until = 1 s;", "until = 0.5 s;"),
        before=rub,
    )
    t = run.time
    np.testing.assert_allclose(of(run, "tau")[t < 0.5], -3.0 * 2.0 / 6.0, rtol=1e-12)
    np.testing.assert_allclose(of(run, "tau")[t > 0.5], -2.0, rtol=1e-12)


@pytest.mark.slow
def test_two_brakes_on_a_joint_add_up(tmp_path: Path) -> None:
    run = ran(
        tmp_path,
        ("from = 0.2 s;", ""),
        ("[0, 0, 3]", "[0, 0, 7]"),
        ("push =", "more = brake { joint = hinge;  torque = 2 N*m; }\n        push ="),
    )
    np.testing.assert_allclose(of(run, "qdd")[run.time < 1.0], 1.0 / INERTIA, rtol=1e-12)


def test_what_is_told_its_acceleration_has_no_brake(tmp_path: Path) -> None:
    ideal = "servo go { model = ideal;  bandwidth = 5 s^-1;  command = rate(0.1 rad/s); }\n"
    run = changed(RUN, ("servos { }", "servos { hinge = go; }"))
    assert [each.code for each in check(tmp_path, ARM, ideal, run).diagnostics] == ["D291"]


def test_a_joint_whose_motor_is_on_a_bed_has_no_brake(tmp_path: Path) -> None:
    run = changed(RUN, ("servos { }", "servos { hinge = drive; }"), ("duration", "substitute hinge { }  duration"))
    assert (
        messages(check(tmp_path, ARM, SERVO, run))
        == """\
error[D244]: `hold` puts friction on joint `hinge`, whose motor is on a bed
  --> deck.ic:15:9
   |
15 |         hold = brake { joint = hinge;  torque = 4 N*m;  from = 0.2 s;  until = 1 s; }
   |         ^^^^
  ::: deck.ic:19:5  on a bed
   = help: leave it out: on a bed, friction is the bed's

1 error
"""
    )
