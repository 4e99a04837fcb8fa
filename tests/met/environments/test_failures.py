"""Servos that fail for a time: a joint that swings freely, a drive that runs away, a law that does not see."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.run import Run
from tests.ic.small_decks import ARM, SERVO, changed, check, codes, experiment, messages

INERTIA, ROTOR = 2.0 / 3.0, 100.0**2 * 1e-4
RUN = """\
run it {
    arm = swing;  servos { hinge = drive; }
    environment {
        fault = FAILURE;
        push = wrench { link = bar;  moment = [0, 0, 2] N*m; }
    }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 1 kHz; }
    duration = 1 s;  record = [q, qd, qdd, tau, servo.voltage];
}
"""
RUB = ("command", "f_c = 0.005 N*m;  command")


def ran(folder: Path, failure: str, servo: str = SERVO, *changes: tuple[str, str]) -> Run:
    return engine.run(experiment(folder, ARM, servo, changed(RUN, ("FAILURE", failure), *changes)))


def of(run: Run, name: str) -> np.ndarray:
    return run.signals[name][0, :, 0]


WINDOW = "joint = hinge;  from = 0.3 s;  until = 0.6 s;"


@pytest.mark.slow
def test_a_joint_that_swings_freely_feels_the_push_and_its_rotor_alone(tmp_path: Path) -> None:
    run = ran(tmp_path, f"free_swinging {{ {WINDOW} }}", changed(SERVO, RUB))
    t, inside = run.time, (run.time >= 0.3) & (run.time < 0.6)
    np.testing.assert_allclose(of(run, "qdd")[inside], 2.0 / (INERTIA + ROTOR), rtol=1e-12)
    assert (of(run, "tau")[inside] == 0.0).all()
    assert abs(of(run, "qd")[t < 0.3][-1] - 0.1) < 0.02 and of(run, "qd")[inside][-1] > 0.3, "and before it is held"
    assert abs(of(run, "qd")[-1] - 0.1) < 0.05, "and afterwards brought back"


@pytest.mark.slow
def test_a_window_within_a_step_acts_in_proportion(tmp_path: Path) -> None:
    run = ran(tmp_path, "free_swinging { joint = hinge;  from = 0.3 s;  until = 0.3005 s; }")
    whole = ran(tmp_path, "free_swinging { joint = hinge;  from = 0.3 s;  until = 0.301 s; }")
    none = ran(tmp_path, "free_swinging { joint = hinge;  from = 2 s; }")
    k = 300
    half = 0.5 * (of(whole, "tau")[k] + of(none, "tau")[k])
    assert of(run, "tau")[k] == pytest.approx(half, rel=1e-9) and of(whole, "tau")[k] == 0.0 != of(none, "tau")[k]


def test_one_that_follows_whatever_the_arm_swings_too(tmp_path: Path) -> None:
    ideal = "servo drive { model = ideal;  bandwidth = 30 s^-1;  command = rate(0.1 rad/s); }\n"
    run = ran(tmp_path, f"free_swinging {{ {WINDOW} }}", ideal, (", servo.voltage", ""))
    inside = (run.time >= 0.3) & (run.time < 0.6)
    np.testing.assert_allclose(of(run, "qdd")[inside], 2.0 / INERTIA, rtol=1e-12)
    assert of(run, "qd")[-1] == pytest.approx(0.1, abs=1e-3)


def test_behind_an_elastic_gear_the_motor_is_let_go_as_well(tmp_path: Path) -> None:
    """Nothing pushes from outside; joint and motor move apart, and what both have of momentum is kept."""
    geared = changed(
        SERVO,
        ("rigid_gearbox", "compliant_gearbox"),
        ("kp = 0.1", "kp = 0"),
        ("ki = 1", "ki = 0"),
        ("kt = 0.05", "kt = 1e-9"),
        ("command", "stiffness = 400 N*m/rad;  command"),
    )
    run = ran(
        tmp_path,
        f"free_swinging {{ {WINDOW} }}",
        geared,
        ("moment = [0, 0, 2] N*m;", "moment = [0, 0, 2] N*m;  until = 0.2 s;"),
        ("servo.voltage", "servo.motor_rate"),
    )
    inside = (run.time > 0.3) & (run.time < 0.6)
    assert np.ptp(of(run, "qd")[inside]) < 1e-15 and np.ptp(of(run, "servo.motor_rate")[inside]) < 1e-12
    both = INERTIA * of(run, "qd") + ROTOR / 100.0 * of(run, "servo.motor_rate")
    np.testing.assert_allclose(both[run.time >= 0.2], 2.0 * 0.2, rtol=1e-12)


def test_a_gear_that_was_let_go_takes_hold_with_nothing_wound_up(tmp_path: Path) -> None:
    """While it is let go motor and joint move apart by radians; the gear has let that slip."""
    geared = changed(
        SERVO,
        ("rigid_gearbox", "compliant_gearbox"),
        ("command", "stiffness = 400 N*m/rad;  damping = 5 N*m*s/rad;  command"),
    )
    run = ran(
        tmp_path,
        f"free_swinging {{ {WINDOW} }}",
        geared,
        ("servo.voltage", "servo.deflection, servo.gear_torque, servo.motor_rate"),
    )
    t, wound = run.time, of(run, "servo.deflection")
    assert abs(wound[t < 0.3][-1]) > 1e-4
    inside, slips = (t >= 0.32) & (t < 0.6), of(run, "servo.motor_rate") / 100.0 - of(run, "qd")
    assert np.abs(slips[inside]).sum() * 1e-3 > 0.05 and np.abs(wound[inside]).max() < 1e-6
    assert (of(run, "servo.gear_torque")[inside] == 0.0).all()
    after = t >= 0.6
    rate = np.abs(slips[inside][-1])  # the blow that catches a motor of another rate, and no more
    assert np.abs(wound[after]).max() < 1.1 * rate / np.sqrt(400.0 / ROTOR + 400.0 / INERTIA) + 2.5 / 400.0


def test_a_drive_that_runs_away_gives_all_it_can(tmp_path: Path) -> None:
    run = ran(tmp_path, f"runaway {{ {WINDOW}  level = -0.5; }}")
    inside = (run.time >= 0.3) & (run.time < 0.6)
    assert (of(run, "servo.voltage")[inside] == -12.0).all() and (of(run, "servo.voltage")[~inside] != -12.0).all()
    assert of(run, "qd")[inside][-1] < -0.5


@pytest.mark.slow
@pytest.mark.parametrize(("reads", "seen"), [("zero", 0.0), ("last", None)])
def test_a_law_that_does_not_see_goes_by_nothing_or_by_what_it_saw_last(
    reads: str, seen: float | None, tmp_path: Path
) -> None:
    """A proportional loop: its voltage is kp N (asked - seen)."""
    run = ran(tmp_path, f"dead_sensor {{ {WINDOW}  of = qd;  reads = {reads}; }}", changed(SERVO, ("ki = 1", "ki = 0")))
    inside = (run.time >= 0.3) & (run.time < 0.6)
    last = of(run, "qd")[run.time < 0.3][-1] if seen is None else seen
    through = changed(SERVO, ("ki = 1", "ki = 0"), ("command", "sensor qd = tachometer { }  command"))
    noted = ran(
        tmp_path,
        f"dead_sensor {{ {WINDOW}  of = qd;  reads = {reads}; }}",
        through,
        ("servo.voltage", "servo.sensor.qd"),
    )
    assert (of(noted, "servo.sensor.qd")[inside] == last).all(), "what the law saw"
    np.testing.assert_allclose(of(run, "servo.voltage")[inside], 0.1 * 100.0 * (0.1 - last), rtol=1e-12)
    assert np.ptp(of(run, "servo.voltage")[~inside]) > 0.0


@pytest.mark.slow
def test_a_continuous_law_fails_as_a_sampled_one(tmp_path: Path) -> None:
    analog = ("servos = 1 kHz", "servos = continuous")
    run = ran(tmp_path, f"runaway {{ {WINDOW} }}", SERVO, analog)
    inside = (run.time >= 0.3) & (run.time < 0.599)
    assert (of(run, "servo.voltage")[inside] == 24.0).all()
    blind = ran(tmp_path, f"dead_sensor {{ {WINDOW}  of = qd; }}", changed(SERVO, ("ki = 1", "ki = 0")), analog)
    np.testing.assert_allclose(of(blind, "servo.voltage")[inside], 1.0, rtol=1e-12)


PASSIVE = "servo drive { model = passive; }\n"
IDEAL = "servo drive { model = ideal;  bandwidth = 30 s^-1;  command = rate(0.1 rad/s); }\n"


@pytest.mark.parametrize(("failure", "servo", "said"), [
    ("free_swinging { joint = hinge; }", "", "joint `hinge` has no servo to which `fault` could do anything"),
    ("runaway { joint = hinge; }", PASSIVE, "servo `drive` (passive) of joint `hinge` has no law that `fault`"),
    ("runaway { joint = hinge; }", IDEAL, "servo `drive` (ideal) of joint `hinge` has no drive that could run away"),
    ("free_swinging { joint = hinge;  until = 0.5 s; }", "servo drive { model = locked; }\n",
     "servo `drive` (locked) of joint `hinge` holds a joint that is at rest, and `fault` would give it one that moves"),
    ("dead_sensor { joint = hinge;  of = motor_rate; }", SERVO, "joint `hinge` does not see `motor_rate`"),
])  # fmt: skip
def test_a_failure_of_what_is_not_there_is_told(failure: str, servo: str, said: str, tmp_path: Path) -> None:
    run = changed(RUN, ("FAILURE", failure), ("record = [q, qd, qdd, tau, servo.voltage]", "record = [q]"))
    run = run if servo else changed(run, ("servos { hinge = drive; }", ""))
    text = messages(check(tmp_path, ARM, servo, run))
    assert text.startswith("error[D247]: ") and said in text


@pytest.mark.slow
def test_what_is_on_a_bed_is_not_let_go_but_may_run_away(tmp_path: Path) -> None:
    bed = changed(RUN, ("duration = 1 s;", "duration = 1 s;  substitute hinge { }"))
    assert codes(tmp_path, ARM, SERVO, changed(bed, ("FAILURE", "free_swinging { joint = hinge; }"))) == ["D247"]
    run = engine.run(experiment(tmp_path, ARM, SERVO, changed(bed, ("FAILURE", f"runaway {{ {WINDOW} }}"))))
    assert (of(run, "servo.voltage")[(run.time >= 0.3) & (run.time < 0.6)] == 24.0).all()


@pytest.mark.slow
def test_a_case_that_never_fails_has_the_bits_of_one_without_the_model(tmp_path: Path) -> None:
    """Nothing is let go of outside of the window: not a bit of the motion moves."""
    never = ran(tmp_path, "free_swinging { joint = hinge;  from = 5 s; }", changed(SERVO, RUB))
    without = ran(tmp_path, "joint_damping { damping = 0 N*m*s/rad; }", changed(SERVO, RUB))
    assert all((never.signals[name] == without.signals[name]).all() for name in never.signals)
