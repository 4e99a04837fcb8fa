"""The ideal servo: the joint follows its command whatever the arm, and tau is what that takes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.plan.channel import channels
from tests.ic import small_decks
from tests.ic.small_decks import ARM, SERVO, changed, check, experiment, messages
from tests.met.tree_deck import GRAVITY, TREE
from tests.oracles.plan_tree import pinocchio

W = 20.0
RUN = """\
servo follow { model = ideal; bandwidth = 20 s^-1; command = rate(0.5 rad/s); }
run it {
    arm = swing;  servos { hinge = follow; }
    environment { gravity = [0, -9.81, 0] m/s^2; }
    rates { dynamics = 500 Hz; servos = 500 Hz; record = 50 Hz; }
    integrator = rk4;  duration = 1 s;  record = [q, qd, qdd, tau];
}
"""


def signals(folder: Path, *changes: tuple[str, str], arm: str = ARM) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(t, signals [row] of the one joint)."""
    found = engine.run(experiment(folder, arm, changed(RUN, *changes)))
    assert found.cause == [""]
    return found.time, {name: array[0, :, 0] for name, array in found.signals.items()}


@pytest.mark.parametrize("mass", ["2 kg", "2000 kg"])
def test_a_rate_is_reached_at_the_bandwidth_whatever_the_arm(tmp_path: Path, mass: str) -> None:
    t, found = signals(tmp_path, arm=changed(ARM, ("2 kg", mass)))
    # rk4 is off by (h w)^4/120 = 2e-8 of what is left to go
    np.testing.assert_allclose(found["qd"], 0.5 * (1.0 - np.exp(-W * t)), rtol=0, atol=2e-8)
    np.testing.assert_allclose(found["q"], 0.5 * (t - (1.0 - np.exp(-W * t)) / W), rtol=0, atol=2e-8)


def test_a_position_is_reached_at_the_bandwidth_without_overshoot(tmp_path: Path) -> None:
    t, found = signals(tmp_path, ("rate(0.5 rad/s)", "position(0.5 rad)"))
    np.testing.assert_allclose(found["q"], 0.5 * (1.0 - (1.0 + W * t) * np.exp(-W * t)), rtol=0, atol=1e-7)
    assert (found["q"] <= 0.5).all()


def test_an_acceleration_is_the_joints(tmp_path: Path) -> None:
    asked = ("bandwidth = 20 s^-1; command = rate(0.5 rad/s)", "command = acceleration(3 rad/s^2)")
    t, found = signals(tmp_path, asked)
    assert (found["qdd"] == 3.0).all()
    np.testing.assert_allclose(found["q"], 1.5 * t**2, rtol=0, atol=1e-13)  # 500 steps' rounding


@pytest.mark.slow
@pytest.mark.parametrize("hz", [4, 500, 2000])
@pytest.mark.parametrize(
    ("command", "q"),
    [
        ("rate(ramp(to = 2 rad/s, over = 1 s))", lambda t: t**2),
        ("position(ramp(start = 0 rad, to = 2 rad, over = 1 s))", lambda t: 2.0 * t),
        ("acceleration(ramp(to = 6 rad/s^2, over = 1 s))", lambda t: t**3),
    ],
)
def test_a_straight_course_is_followed_exactly_at_any_rate_of_the_servo(
    tmp_path: Path, hz: int, command: str, q: Callable[[np.ndarray], np.ndarray]
) -> None:
    """The command is carried on along its slope between ticks, also by a servo that ticks within a step."""
    moving = "initial { hinge.qd = 2 rad/s; }" if "position" in command else ""
    start = ("arm = swing;", f"arm = swing;  {moving}")
    t, found = signals(tmp_path, ("rate(0.5 rad/s)", command), ("servos = 500 Hz", f"servos = {hz} Hz"), start)
    before_end = t < 1.0  # at the end of the ramp the slope is zero: what follows is none of the course
    np.testing.assert_allclose(found["q"][before_end], q(t[before_end]), rtol=0, atol=1e-12)  # 500 steps' rounding


@pytest.mark.oracle
def test_the_torque_is_that_of_inverse_dynamics_with_the_rotors_share(tmp_path: Path) -> None:
    run = f"""\
servo spin {{ model = ideal; bandwidth = 10 s^-1; rotor = 0.4 kg*m^2; command = rate(sine(amplitude = 1 rad/s, frequency = 1 Hz)); }}
servo slide {{ model = ideal; bandwidth = 15 s^-1; rotor = 3 kg; command = position(0.2 m); }}
servo wave {{ model = ideal; rotor = 0.1 kg*m^2; command = acceleration(sine(amplitude = 4 rad/s^2, frequency = 2 Hz)); }}
run it {{
    arm = tree;  servos {{ turn = spin;  raise = wave;  push = slide;  wag = wave; }}
    environment {{ gravity = [{", ".join(map(str, GRAVITY))}] m/s^2; }}
    rates {{ dynamics = 500 Hz; servos = 500 Hz; record = 50 Hz; }}
    duration = 1 s;  record = [q, qd, qdd, tau];
}}
"""  # noqa: E501 - a deck is as wide as it is
    deck = experiment(tmp_path, TREE, run)
    found = engine.run(deck)
    assert found.cause == [""]
    arm = pinocchio(deck, gravity=GRAVITY, rotor=[0.4, 0.1, 3.0, 0.1])
    for q, qd, qdd, tau in zip(*(found.signals[name][0] for name in ("q", "qd", "qdd", "tau")), strict=True):
        # inverse dynamics is well conditioned: some hundreds of roundings of torques up to 100 N m
        assert np.abs(tau - arm.torques(q, qd, qdd, {})).max() < 1e-11


def test_a_sweep_of_the_bandwidth_reaches_every_case(tmp_path: Path) -> None:
    sweep = "sweep some of it { vary follow.bandwidth = [5, 10, 20] s^-1; }\n"
    found = engine.run(experiment(tmp_path, ARM, RUN, sweep, select=["some"]))
    expected = 0.5 * (1.0 - np.exp(-np.outer([5.0, 10.0, 20.0], found.time)))
    np.testing.assert_allclose(found.signals["qd"][:, :, 0], expected, rtol=0, atol=2e-8)


@pytest.mark.parametrize(
    ("command", "units"),
    [
        ("rate(0.5 rad/s)", ("rad/s", "rad/s^2", "rad/s")),
        ("position(0.5 rad)", ("rad", "rad/s", "rad")),
        ("acceleration(5 deg/s^2)", ("rad/s^2", "rad/s^3", "rad/s^2")),
    ],
)
def test_what_is_held_has_the_commands_unit(tmp_path: Path, command: str, units: tuple[str, ...]) -> None:
    deck = experiment(tmp_path, ARM, changed(RUN, ("rate(0.5 rad/s)", command)))
    known = channels(deck.structure)
    assert tuple(known[f"hinge.servo.{name}"].unit for name in ("value", "slope", "command")) == units


def test_its_mode_is_of_the_bandwidth(tmp_path: Path) -> None:
    (note,) = experiment(tmp_path, ARM, RUN).notes
    assert "joint `hinge` decays" in note and "h * lambda = 0.04," in note


def test_a_rate_or_position_needs_a_bandwidth(tmp_path: Path) -> None:
    for command, place in (("rate(0.5 rad/s)", "rate(0.5 rad/s)"), ("position(1 rad)", "position(1 rad)")):
        text = changed(RUN, (" bandwidth = 20 s^-1;", ""), ("rate(0.5 rad/s)", command))
        assert (
            messages(check(tmp_path, ARM, text))
            == f"""\
error[D160]: servo `follow` needs `bandwidth` under a {place.partition("(")[0]} command
 --> deck.ic:5:41
  |
5 | servo follow {{ model = ideal; command = {place}; }}
  |                                         {"^" * len(place)}
  = help: write `bandwidth = ... 1/s;`: errors decay as exp(-bandwidth t); used only under a rate or position command

1 error
"""
        )


def test_a_servo_that_takes_no_acceleration_says_so(tmp_path: Path) -> None:
    gearbox = changed(SERVO, ("rate(0.1 rad/s)", "acceleration(1 rad/s^2)"))
    assert (
        messages(check(tmp_path, ARM, gearbox, small_decks.RUN))
        == """\
error[D152]: the model `rigid_gearbox` takes no command `acceleration`
 --> deck.ic:9:15
  |
9 |     command = acceleration(1 rad/s^2);
  |               ^^^^^^^^^^^^
  = help: it takes rate(...), position(...), torque(...)

1 error
"""
    )


def test_an_acceleration_in_another_unit_is_told(tmp_path: Path) -> None:
    text = changed(RUN, ("rate(0.5 rad/s)", "acceleration(0.5 rad/s)"))
    assert (
        messages(check(tmp_path, ARM, text))
        == """\
error[D061]: the command of servo `follow` is in rad/s^2, and this is in rad/s
 --> deck.ic:5:75
  |
5 | servo follow { model = ideal; bandwidth = 20 s^-1; command = acceleration(0.5 rad/s); }
  |                                                                           ^^^^^^^^^
  = help: `acceleration(...)` takes rad/s^2; `rate(...)` takes rad/s

1 error
"""
    )
