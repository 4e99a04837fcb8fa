"""A gear that winds up between two inertias: its frequency, its play, friction on both sides of it, and its losses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.run import Run
from tests.ic.small_decks import ARM, changed, experiment

ROTOR, ARM_INERTIA, STIFFNESS = 100.0**2 * 1e-4, 2.0 / 3.0, 500.0
"""At the joint, kg m^2 and N m/rad: of the rotor behind the gear, of the rod about its end."""

# A motor that does nothing, unless it is given a gain: no back-EMF that counts, no friction.
SERVO = """\
servo drive {
    model = compliant_gearbox;  rate = continuous;
    ratio = 100;  kp = 0 V*s/rad;  ki = 0 V/rad;  v_max = 24 V;  resistance = 1 ohm;  kt = 1e-9 N*m/A;  tau_max = 1 N*m;
    j_m = 1e-4 kg*m^2;  stiffness = 500 N*m/rad;
    command = rate(0 rad/s);
}
"""
RUN = """\
run it {
    arm = swing;  servos { hinge = drive; }
    environment { push = wrench { link = bar;  moment = [0, 0, 6] N*m; } }
    rates { dynamics = 5 kHz;  record = 500 Hz; }
    integrator = rk4;  duration = 0.5 s;
    record = [q, qd, qdd, servo.deflection, servo.motor_rate, servo.gear_torque];
}
"""


def ran(folder: Path, *changes: tuple[str, str], select: list[str] | None = None, more: str = "") -> Run:
    text = changed(SERVO + RUN, *changes)
    return engine.run(experiment(folder, ARM, text, more, select=select or ["it"]))


def of(run: Run, name: str, case: int = 0) -> np.ndarray:
    return run.signals[name][case, :, 0]


def test_two_inertias_swing_at_the_frequency_of_the_formula(tmp_path: Path) -> None:
    """Pushed at the joint from rest, wound up by d: d'' = -w^2 d - M/J, w^2 = k (1/(N^2 J_m) + 1/J)."""
    run = ran(tmp_path)
    w = np.sqrt(STIFFNESS * (1.0 / ROTOR + 1.0 / ARM_INERTIA))
    wound = -6.0 / (ARM_INERTIA * w**2) * (1.0 - np.cos(w * run.time))
    # rk4 is off by (h w)^4/120 w t: 7e-3^4/120 * 18, of 6e-3 rad
    np.testing.assert_allclose(of(run, "servo.deflection"), wound, rtol=0, atol=1e-11)
    together = 6.0 / (ROTOR + ARM_INERTIA)  # acceleration of the centre of both
    both = ARM_INERTIA * of(run, "qd") + ROTOR / 100.0 * of(run, "servo.motor_rate")
    np.testing.assert_allclose(both, (ROTOR + ARM_INERTIA) * together * run.time, rtol=0, atol=1e-12)


def test_a_hardening_gear_keeps_its_energy(tmp_path: Path) -> None:
    """k1 d^2/2 + k3 d^4/4 and both kinetic energies: what the push has put in, and what is recorded as energy."""
    errors = []
    for rate in ("1 kHz", "2 kHz"):
        run = ran(
            tmp_path,
            ("stiffness = 500 N*m/rad;", "stiffness = 500 N*m/rad;  hardening = 2e7 N*m/rad^3;"),
            ("dynamics = 5 kHz", f"dynamics = {rate}"),
            ("[q, qd, qdd,", "[q, qd, energy,"),
        )
        d, q, qd, w = (of(run, name) for name in ("servo.deflection", "q", "qd", "servo.motor_rate"))
        energy = 500.0 * d**2 / 2.0 + 2e7 * d**4 / 4.0 + ARM_INERTIA * qd**2 / 2.0 + 1e-4 * w**2 / 2.0
        assert (2e7 * d**2).max() > 500.0, "the cubic part is the larger one"
        errors.append(np.abs(energy - 6.0 * q).max())
        stored = run.signals["energy.kinetic"][0] + run.signals["energy.potential"][0]
        np.testing.assert_allclose(stored, energy, rtol=1e-13)
    assert errors[1] < 1e-7 * (6.0 * 0.5)
    assert 12.0 < errors[0] / errors[1] < 40.0, "as the integrator's order, 4, and the next"


def test_teeth_push_and_never_pull(tmp_path: Path) -> None:
    """Shaken to and fro across the play, with a damping that would pull as they part."""
    run = ran(
        tmp_path,
        ("stiffness = 500", "backlash = 0.02 rad;  damping = 5 N*m*s/rad;  stiffness = 500"),
        (
            "moment = [0, 0, 6] N*m; }",
            "moment = [0, 0, 6] N*m;  until = 60 ms; }\n"
            "    pull = wrench { link = bar;  moment = [0, 0, -6] N*m;  from = 60 ms;  until = 0.16 s; }",
        ),
        ("record = 500 Hz", "record = 5 kHz"),
    )
    d, torque = of(run, "servo.deflection"), of(run, "servo.gear_torque")
    beyond = d - np.clip(d, -0.01, 0.01)
    assert (torque[beyond == 0.0] == 0.0).all() and (torque * np.sign(beyond) >= 0.0).all()
    assert (beyond > 0.0).sum() > 100 and (beyond < 0.0).sum() > 100 and (beyond == 0.0).sum() > 100
    # damping never doubles the spring's torque, nor takes it below nothing
    assert (np.abs(torque) <= 2.0 * STIFFNESS * np.abs(beyond)).all()
    assert (np.abs(torque)[np.abs(torque) > 0.0] < STIFFNESS * np.abs(beyond)[np.abs(torque) > 0.0]).any()


STUCK = (("j_m = 1e-4", "f_c = 0.02 N*m;  j_m = 1e-4"), ("stiffness = 500", "damping = 4 N*m*s/rad;  stiffness = 500"))


@pytest.mark.slow
def test_a_motor_that_sticks_does_not_creep_in_an_hour(tmp_path: Path) -> None:
    """Held by 0.98 of what breaks it away, N F_c, through the wound gear, once the jolt at the start is over."""
    run = ran(
        tmp_path,
        *STUCK,
        ("[0, 0, 6] N*m", "[0, 0, 1.96] N*m"),
        ("dynamics = 5 kHz", "dynamics = 200 Hz"),
        ("record = 500 Hz", "record = 0.1 Hz"),
        ("duration = 0.5 s", "duration = 3600 s"),
    )
    assert (of(run, "servo.motor_rate") == 0.0).all()
    held = (of(run, "q") + of(run, "servo.deflection"))[1:]  # the motor's angle over the ratio
    assert np.ptp(held) < 1e-15, "roundings of the two, which move against each other"
    np.testing.assert_allclose(of(run, "servo.deflection")[-1], -1.96 / STIFFNESS, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("moment", "moves"), [("2.05", True), ("1.99", False)])
def test_it_breaks_away_where_the_gear_pulls_harder_than_friction(tmp_path: Path, moment: str, moves: bool) -> None:
    """The push grows slowly enough for the gear not to overshoot: it is ten times damped."""
    run = ran(
        tmp_path,
        *STUCK,
        ("damping = 4", "damping = 100"),
        ("[0, 0, 6] N*m", f"[0, 0, {moment}] N*m"),
        ("duration = 0.5 s", "duration = 20 s"),
        ("record = 500 Hz", "record = 5 Hz"),
    )
    assert bool(of(run, "servo.motor_rate")[-1]) is moves


@pytest.mark.slow
def test_friction_at_the_joint_sticks_behind_a_motor_that_turns(tmp_path: Path) -> None:
    run = ran(tmp_path, ("stiffness = 500", "f_c_joint = 8 N*m;  stiffness = 500"))
    assert (of(run, "q") == 0.0).all() and (of(run, "servo.motor_rate") == 0.0).all(), "6 N m do not move 8"
    run = ran(
        tmp_path,
        ("stiffness = 500", "f_c_joint = 8 N*m;  stiffness = 500"),
        ("kp = 0", "kp = 1"),
        ("kt = 1e-9", "kt = 0.05"),
        ("rate(0 rad/s)", "rate(0.3 rad/s)"),
        ("duration = 0.5", "duration = 2"),
        ("    environment { push = wrench { link = bar;  moment = [0, 0, 6] N*m; } }\n", ""),
    )
    d, qd = of(run, "servo.deflection"), of(run, "qd")
    waits = qd == 0.0
    assert waits[:3].all() and (d[waits] * STIFFNESS <= 8.0 + 1e-9).all(), "the gear is wound up first"
    assert not waits[-1] and qd[-1] > 0.1


@pytest.mark.slow
def test_a_gear_with_a_loss_takes_more_to_drive_and_less_to_hold_back(tmp_path: Path) -> None:
    """At a steady rate against a moment, (1 + loss) of its share; driven back by it, (1 - loss)."""
    steady = (
        ("stiffness = 500", "loss = 0.3;  damping = 50 N*m*s/rad;  stiffness = 500"), ("kt = 1e-9", "kt = 0.05"),
        ("kp = 0", "kp = 1"), ("ki = 0", "ki = 20"), ("duration = 0.5 s", "duration = 4 s"),
        ("servo.gear_torque]", "servo.gear_torque, servo.motor_torque]"),
    )  # fmt: skip
    for rate, moment, share in (("0.2", "-6", 1.3), ("0.2", "6", 0.7), ("-0.2", "-6", 0.7)):
        run = ran(tmp_path, *steady, ("rate(0 rad/s)", f"rate({rate} rad/s)"), ("[0, 0, 6]", f"[0, 0, {moment}]"))
        assert of(run, "qd")[-1] == pytest.approx(float(rate), rel=1e-9)
        assert of(run, "servo.motor_torque")[-1] == pytest.approx(share * -float(moment) / 100.0, rel=1e-9)


@pytest.mark.release
def test_modified_euler_keeps_its_order_through_events_of_both_sides(tmp_path: Path) -> None:
    """Motor and joint stick and slip under an alternating torque of the motor."""
    moving = (
        ("stiffness = 500", "f_c_joint = 1 N*m;  f_c = 0.02 N*m;  damping = 1 N*m*s/rad;  stiffness = 500"),
        ("kt = 1e-9", "kt = 0.05"), ("rate(0 rad/s)", "torque(sine(amplitude = 9 N*m, frequency = 1.3 Hz))"),
        ("    environment { push = wrench { link = bar;  moment = [0, 0, 6] N*m; } }\n", ""),
        ("integrator = rk4", "integrator = modified_euler"), ("duration = 0.5 s", "duration = 3 s"),
        ("record = 500 Hz", "record = 50 Hz"),
    )  # fmt: skip
    found, rates = {}, (500, 1000, 2000, 4000, 8000, 16000)
    for rate in (*rates, 256000):
        run = ran(tmp_path, *moving, ("dynamics = 5 kHz", f"dynamics = {rate} Hz"))
        assert run.events["splits"][0] == 14 and run.events["clamped"][0] == 0
        found[rate] = np.stack([of(run, "q"), of(run, "servo.deflection")])
    errors = [np.sqrt(np.mean((found[rate] - found[256000]) ** 2)) for rate in rates]
    # where in its step a joint breaks away differs from rate to rate, so errors fall unevenly: 1.87 on the whole
    assert np.polyfit(np.log(rates), np.log(errors), 1)[0] < -1.8, errors


def test_a_run_begins_with_the_motor_turning_with_the_joint(tmp_path: Path) -> None:
    run = ran(
        tmp_path,
        (
            "    environment { push = wrench { link = bar;  moment = [0, 0, 6] N*m; } }\n",
            "    initial { hinge.q = 1 rad;  hinge.qd = 0.5 rad/s; }\n",
        ),
    )
    np.testing.assert_allclose(of(run, "servo.motor_rate"), 50.0, rtol=1e-13)
    np.testing.assert_allclose(of(run, "servo.deflection"), 0.0, atol=1e-15)
    np.testing.assert_allclose(of(run, "q"), 1.0 + 0.5 * run.time, rtol=1e-13)
