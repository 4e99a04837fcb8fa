"""Stops that are too stiff for the dynamics' step."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.analysis.contact import contacts
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, experiment, messages

STOP = "environment { end = joint_stop { joint = hinge;  upper = 1 deg;  stiffness = STIFF N*m/rad; } }"
RIGID = 2.0 / 3.0 + 100.0**2 * 1e-4
"""What the joint feels: the rod about its end, and the rotor of its servo."""


def deck(stiffness: float, *changes: tuple[str, str]) -> str:
    return changed(RUN, ("record = [q];", f"record = [q, qd]; {STOP.replace('STIFF', repr(stiffness))}"), *changes)


def test_a_contact_lasts_half_a_swing_of_arm_and_rotor(tmp_path: Path) -> None:
    (found,) = contacts(experiment(tmp_path, ARM, SERVO, deck(500.0)))
    assert (found.stop, found.body) == ("end", "joint `hinge`") and found.inertia == pytest.approx(RIGID, rel=1e-14)
    assert found.steps == pytest.approx(np.pi * np.sqrt(RIGID / 500.0) / 1e-3, rel=1e-14)


def test_below_ten_steps_it_is_warned_and_of_rk4_below_four(tmp_path: Path) -> None:
    def stiffness(steps: float) -> float:
        return float(RIGID * (np.pi / (steps * 1e-3)) ** 2)

    rk4 = ("duration", "integrator = rk4;  duration")
    assert messages(check(tmp_path, ARM, SERVO, deck(stiffness(10.1)))) == ""
    assert messages(check(tmp_path, ARM, SERVO, deck(stiffness(4.1), rk4))) == ""
    assert messages(check(tmp_path, ARM, SERVO, deck(stiffness(3.9), rk4))).startswith("warning[D295]")
    text = messages(check(tmp_path, ARM, SERVO, deck(stiffness(5.0))))
    assert text.startswith("""\
warning[D295]: `end` is stiff for the dynamics' step: joint `hinge` touches it for 5 steps
"""), text
    assert text.endswith("""\
   = help: with modified_euler a contact of fewer than 10 steps gives energy that nobody put in
   = help: quicken the dynamics to 2000 Hz, or make it softer: it feels 1.67 kg m^2 at the start

1 warning
"""), text


def test_of_a_sweep_the_stiffest_case_counts_and_a_stop_without_ends_does_not(tmp_path: Path) -> None:
    sweep = "sweep stiff of hold { vary environment.end.stiffness = [100, 1e9, 200] N*m/rad; }"
    text = messages(check(tmp_path, ARM, SERVO, deck(100.0), sweep, select=["stiff"]))
    assert text.startswith("warning[D295]: ") and "joint `hinge` touches it for 0.13 steps" in text
    endless = deck(1e9).replace("upper = 1 deg;  ", "")
    assert "D295" not in messages(check(tmp_path, ARM, SERVO, endless))


def test_a_joint_that_is_told_its_acceleration_is_not_pushed(tmp_path: Path) -> None:
    ideal = "servo drive { model = ideal;  bandwidth = 30 1/s;  command = rate(0.1 rad/s); }\n"
    assert contacts(experiment(tmp_path, ARM, ideal, deck(1e9))) == ()


def test_with_numbers_at_their_ends_it_is_no_fault(tmp_path: Path) -> None:
    """A mass whose inverse is infinite leaves nothing to feel; such a rotor is sent back in no step of any rate."""
    nothing = changed(ARM, ("mass = 2 kg", "mass = 1e-308 kg"))
    assert contacts(experiment(tmp_path, nothing, deck(500.0, ("servos { hinge = drive; }", "servos { }")))) == ()
    rotor = changed(SERVO, ("ratio = 100", "ratio = 1"), ("j_m = 1e-4", "j_m = 1e-308"), ("kt = 0.05", "kt = 1e-308"))
    text = messages(check(tmp_path, nothing, rotor, deck(1e308)))
    assert "touches it for 0 steps" in text and "no rate is so high: make it softer" in text


@pytest.mark.parametrize(("steps", "least", "most"), [(2.0, 1.0, 6.0), (10.0, 0.005, 0.04)])
def test_what_is_warned_of_is_true(steps: float, least: float, most: float, tmp_path: Path) -> None:
    """The energy that a bounce gains, at the worst of twenty places of the first step in it."""
    inertia = 2.0 / 3.0
    run = deck(
        float(inertia * (np.pi / (steps * 1e-3)) ** 2),
        ("servos { hinge = drive; }", "servos { }"),
        ("duration = 1 s", "initial { hinge.qd = 1 rad/s; }  duration = 0.1 s"),
    )
    sweep = "sweep places of hold { vary initial.hinge.q = linspace(0, 1, 20) mrad; }"
    qd = engine.run(experiment(tmp_path, ARM, run, sweep, select=["places"])).signals["qd"][:, -1, 0]
    assert least < (qd**2).max() - 1.0 < most
