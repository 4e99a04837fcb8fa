"""What slides so slowly that its dry friction would stop it within a step is told; what is faster is not."""

from __future__ import annotations

import pytest

import ic
from batch.terminal.linear import as_data, linear_lines
from met.analysis.linear.answers import LinearQuestion
from met.analysis.linear.shafts import CreepingRate, creeping
from tests.met.analysis.linear.oracles import at_instant

DECK = """\
#include <servos/rigid_gearbox.ic>
arm swing {
    link bar { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo drive like rigid_gearbox {
    ratio = 50;  j_m = 6.4e-5 kg*m^2;  f_c = 0.02 N*m;  kp = 0 V*s/rad;  ki = 0 V/rad;  command = rate(0 rad/s);
}
run slow {
    arm = swing;  servos { hinge = drive; }  rates { dynamics = 100 Hz;  servos = 100 Hz; }
    environment { gravity = gravity(g = [0, PULL, 0] m/s^2); }
    initial { hinge.qd = RATE rad/s; }  duration = 1 s;  record = [q];
}
"""
FRICTION = 50.0 * 0.02
"""N m at the joint; the pull of g on the bar about its end is g times 2 kg times 0.5 m."""

STOPPED = 0.01 * FRICTION / (2.0 / 3.0 + 50.0**2 * 6.4e-5)
"""The rate, rad/s, that dry friction takes in a step of a bar about its end, with its motor's shaft."""


def question(rate: float, pull: float) -> LinearQuestion:
    text = DECK.replace("RATE", repr(rate)).replace("PULL", repr(pull))
    (experiment,) = ic.compile(text=text).experiments
    return LinearQuestion(experiment)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_edge_is_the_rate_that_friction_takes_in_a_step(way: float) -> None:
    """Weight pulls one way, and back-EMF slows: the edge is that of friction alone, in closed form."""

    def told(rate: float) -> tuple[CreepingRate, ...]:
        (found,) = creeping([at_instant(question(rate, -0.7).program, 0, 0)])
        return found

    slow, fast = way * STOPPED * (1.0 - 1e-9), way * STOPPED * (1.0 + 1e-9)
    assert told(slow) == (CreepingRate("hinge", slow, "rad/s"),) and told(fast) == ()


def test_a_joint_that_creeps_is_named_with_its_rate() -> None:
    """Its weight is a little more than its friction, so it goes on."""
    found = question(-3e-8, -(FRICTION + 1e-6)).of(0)
    line = "  hinge creeps at 3e-08 rad/s: the answer holds for moves slower than that"
    assert list(linear_lines(found))[1] == line
    assert as_data(found)["creeping"] == [{"name": "hinge", "rate": -3e-8}]
    assert found.states[:2] == ("hinge.q", "hinge.qd")


def test_one_that_moves_and_one_that_sticks_are_not_said_to_creep() -> None:
    assert question(0.1, 0.0).of(0).creeping == ()
    stuck = question(0.0, 0.0).of(0)
    assert stuck.creeping == () and stuck.held == ("hinge",)


@pytest.mark.parametrize(("times", "creeps"), [(1.0 - 1e-9, True), (1.0 + 1e-9, False)])
def test_a_motor_behind_an_elastic_gear_creeps_by_its_own_friction(times: float, creeps: bool) -> None:
    """Its friction takes f_c/j_m of its rate in a second, whatever the arm is."""
    elastic = "model = compliant_gearbox;  stiffness = 1e4 N*m/rad;  damping = 10 N*m*s/rad;  kp"
    slow = 1e-3 * 0.02 / 6.4e-5 / 50.0
    text = DECK.replace("kp", elastic, 1).replace("100 Hz", "1 kHz").replace("PULL", "0.0")
    (experiment,) = ic.compile(text=text.replace("RATE", repr(times * slow))).experiments
    (found,) = creeping([at_instant(LinearQuestion(experiment).program, 0, 0)])
    assert [(each.name, each.unit) for each in found] == [("hinge.servo.motor_rate", "rad/s")] * creeps
