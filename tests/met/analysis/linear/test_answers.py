"""Linear answers against closed forms: poles, who takes part in them, natural modes, opened loops; and refusals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met.analysis.linear.answers import linear
from met.diagnostic import Problem
from tests.ic.small_decks import experiment
from tests.met.analysis.linear.test_jacobian import swing

PASSIVE = "servo drive { model = passive;  stiffness = 320 N*m/rad;  damping = 4 N*m*s/rad; }"


def test_a_sprung_bar_swings_as_its_closed_form(tmp_path: Path) -> None:
    """J = 0.3 + 2 * 0.5^2 = 0.8: w = 20 rad/s, damping 4/(2 * 20 * 0.8) = 1/8; and Heun's step of it."""
    found = linear(swing(tmp_path, SERVO=PASSIVE))
    (natural,) = found.natural
    assert math.isclose(natural.hz, 20.0 / (2.0 * math.pi), rel_tol=1e-13)
    assert math.isclose(natural.damping, 0.125, rel_tol=1e-13)
    assert math.isclose(natural.seconds, 1.0 / 2.5, rel_tol=1e-13)
    (pole,) = found.poles
    x = 1e-3 * complex(-2.5, math.sqrt(400.0 - 6.25))
    assert abs(pole.z - (1.0 + x + 0.5 * x * x)) < 1e-14
    ((joint, share),) = found.by_joint(pole)
    assert joint == "hinge" and math.isclose(share, 1.0) and dict(pole.shares).keys() == {"hinge.q", "hinge.qd"}


def test_of_an_opened_loop_the_gain_is_that_of_the_deck(tmp_path: Path) -> None:
    """kp = 0.02, and so many times that, at which the loop is on the edge, has a pole on the unit circle."""
    made = swing(tmp_path)
    (loop,) = linear(made, opened=["hinge.servo.voltage"]).loops
    assert loop.stable and loop.ticks == 1 and loop.margins is not None and loop.loop is not None
    up = loop.margins.gain_up
    assert up is not None and loop.gains == (loop.margins.gain_down, up)
    served = swing(tmp_path, SERVO=_drive(kp=0.02 * up, ki=0.1 * up))
    sizes = sorted(abs(pole.z) for pole in linear(served).poles)
    assert abs(sizes[-1] - 1.0) < 1e-10


def _drive(*, kp: float, ki: float) -> str:
    from tests.met.analysis.linear.test_jacobian import DRIVE

    return DRIVE.replace("kp = 0.02 V*s/rad", f"kp = {kp!r} V*s/rad").replace("ki = 0.1 V/rad", f"ki = {ki!r} V/rad")


def test_a_loop_that_is_opened_has_the_poles_of_the_arm_without_it(tmp_path: Path) -> None:
    """Opened at its voltage, what is left is the motor's own decay, its integral and the position: 1, 1."""
    (loop,) = linear(swing(tmp_path), opened=["hinge.servo.voltage"]).loops
    assert loop.loop is not None
    N, kt, R, J = 50.0, 0.06, 2.0, 0.8 + 0.25
    x = -1e-3 * N * N * (kt * kt / R + 1e-5) / J
    decay = (1.0 + x + 0.5 * x * x) ** 4
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(loop.loop.A)), [decay, 1.0, 1.0], rtol=1e-7)


def test_the_gain_of_a_loop_at_low_frequency_is_that_of_its_integrals(tmp_path: Path) -> None:
    """L(w) -> ki N^2 times the motor's gain over (w)^2 ... |L| w^1: the integral of the rate's answer to a voltage."""
    (loop,) = linear(swing(tmp_path), opened=["hinge.servo.voltage"]).loops
    assert loop.loop is not None
    w, N, kt, R = 1e-3, 50.0, 0.06, 2.0
    rate_per_volt = N * kt / R / (N * N * (kt * kt / R + 1e-5))
    L = loop.loop.response(np.array([w]))[0]
    assert math.isclose(abs(L), 0.1 * N * rate_per_volt / w, rel_tol=1e-3)


def test_several_loops_are_opened_each_alone_and_all_at_once(tmp_path: Path) -> None:
    deck = """\
    arm two {
        link a { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [Jb, Jb, Jb]; }
        link b { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [Jb, Jb, Jb]; }
        joint x revolute { parent = base;  child = a;  axis = z; }
        joint y revolute { parent = base;  child = b;  axis = z; }
    }
    let Jb = 0.8 kg*m^2;
    SERVO
    run hold {
        arm = two;  servos { x = drive;  y = drive; }
        rates { dynamics = 1 kHz;  servos = 250 Hz; }  duration = 1 s;  record = [q];
    }
    """
    from tests.met.analysis.linear.test_jacobian import DRIVE

    servo = DRIVE.replace("VMAX", "20 V").replace("TAU", "5 N*m").replace("MORE", "")
    found = linear(experiment(tmp_path, deck.replace("SERVO", servo)), opened=["x.servo.voltage", "y.servo.voltage"])
    one, other, both = found.loops
    assert one.margins is not None and both.paths == ("x.servo.voltage", "y.servo.voltage") and both.loop is None
    assert one.gains[1] == pytest.approx(other.gains[1], rel=1e-9)
    assert both.gains[1] == pytest.approx(one.gains[1], rel=1e-5)  # alike, and nothing between them
    by_joint = {joint for pole in found.poles for joint, share in found.by_joint(pole) if share > 0.5}
    assert by_joint == {"x", "y"}


def test_a_run_that_has_failed_is_refused(tmp_path: Path) -> None:
    heavy = "servo drive { model = passive;  stiffness = 1e9 N*m/rad; }"
    made = swing(tmp_path, SERVO=heavy)
    with pytest.raises(Problem) as refused:
        linear(made, at=1.9)
    (told,) = refused.value.diagnostics
    assert told.code == "D371"
    assert told.message == "`hold` has failed before t = 1.9 s, so there is nothing to linearise"
    assert told.help == ("`met run` says when and why; ask at an instant before that, `--at`",)


def test_rates_that_hardly_ever_meet_are_refused(tmp_path: Path) -> None:
    from dataclasses import replace

    made = swing(tmp_path)
    (use,) = made.structure.servos
    rare = replace(made, structure=replace(made.structure, servos=(replace(use, divisor=7001),)))
    with pytest.raises(Problem) as refused:
        linear(rare)
    (told,) = refused.value.diagnostics
    assert told.code == "D374"
    assert told.message == "the computers of `hold` all tick together only every 7.001 s, 7,001 ticks"
    assert told.help == ("choose rates of which one divides the other: 5,000 ticks of the base rate are looked at",)


@pytest.mark.slow
def test_a_motor_on_a_bed_is_linearised_with_its_bed_and_observer(tmp_path: Path) -> None:
    """The shaft's rate is that of the bed, and what the loop does is nearly what the joint's own motor does."""
    from tests.met.analysis.linear.oracles import DECKS

    text = (DECKS / "two_link.ic").read_text().replace("emulated(faults = typical)", "emulated")
    (tmp_path / "deck.ic").write_text(text)
    import ic

    plan = ic.compile(tmp_path / "deck.ic", select=["nominal", "hybrid"])
    own, bed = (linear(each, at=10.0, outputs=["shoulder.qd"]) for each in plan.experiments)
    assert {"shoulder.bed.shaft_rate", "shoulder:observer.w"} <= set(bed.states)
    slow = [sorted(abs(pole.z) for pole in each.poles if 0.9 < abs(pole.z) < 0.999) for each in (own, bed)]
    np.testing.assert_allclose(*slow, rtol=5e-4)


def test_a_law_that_is_continuous_is_part_of_the_arm(tmp_path: Path) -> None:
    made = swing(tmp_path, MORE="rate = continuous;")
    with pytest.raises(Problem) as refused:
        linear(made, opened=["hinge.servo.voltage"])
    (told,) = refused.value.diagnostics
    assert told.message == "there is no place to open a loop `hinge.servo.voltage`"
    assert told.help == (
        "a law that is `continuous` is a part of the arm, and has no loop to open",
        "a fast computer is nearly the same: write `rate = 1000 Hz;`, that of the dynamics, in the servo of `hinge`",
    )
    assert linear(swing(tmp_path, MORE="rate = 1000 Hz;"), opened=["hinge.servo.voltage"]).loops
