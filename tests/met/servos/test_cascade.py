"""The cascaded servo: its current loop against the closed form, its limits, its two gears, sampled and continuous."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lti, step

from met import run as engine
from met.run import Run
from tests.ic.small_decks import ARM, changed, experiment

SERVO = """\
servo drive {
    model = cascade;  rate = continuous;
    ratio = 100;  k_position = 20 s^-1;  kp = 1 A*s/rad;  ki = 10 A/rad;
    k_current = 2 V/A;  ki_current = 4000 V/(A*s);
    resistance = 1 ohm;  inductance = 2 mH;  kt = 0.05 N*m/A;
    j_m = 1e-4 kg*m^2;  f_c = 0.01 N*m;  f_v = 1e-4 N*m*s/rad;
    stiffness = 20000 N*m/rad;  damping = 20 N*m*s/rad;
    command = position(trapezoid(to = 1 rad, max_rate = 1 rad/s, max_acceleration = 4 rad/s^2));
}
"""
RUN = """\
run it {
    arm = swing;  servos { hinge = drive; }
    rates { dynamics = 20 kHz;  record = 1 kHz; }
    duration = 2 s;
    record = [q, qd, servo.current, servo.voltage, servo.current_cmd, servo.integral];
}
"""


def ran(folder: Path, *changes: tuple[str, str]) -> Run:
    return engine.run(experiment(folder, ARM, changed(SERVO + RUN, *changes)))


def of(run: Run, name: str) -> np.ndarray:
    return run.signals[name][0, :, 0]


HELD = ("f_c = 0.01 N*m", "f_c = 100 N*m")
"""The shaft does not turn."""


def test_the_current_loop_answers_a_step_as_its_transfer_function_does(tmp_path: Path) -> None:
    """i/i_cmd = (Kp s + Ki)/(L s^2 + (R + Kp) s + Ki), with the rotor held."""
    command = ("position(trapezoid(to = 1 rad, max_rate = 1 rad/s, max_acceleration = 4 rad/s^2))", "torque(5 N*m)")
    run = ran(tmp_path, HELD, command, ("duration = 2 s", "duration = 50 ms"))
    assert (of(run, "q") == 0.0).all()
    _, expected = step(lti([2.0, 4000.0], [2e-3, 3.0, 4000.0]), T=run.time)
    # modified Euler at h = 50 us of a loop at 1414/s: (h w)^2/6 a radian, and some more at the jump
    np.testing.assert_allclose(of(run, "servo.current"), expected, rtol=0, atol=2e-3)
    assert of(run, "servo.current")[-1] == pytest.approx(1.0, abs=1e-9) and np.ptp(of(run, "servo.current_cmd")) == 0.0


@pytest.mark.slow
def test_it_comes_to_where_it_is_told_and_follows_on_the_way(tmp_path: Path) -> None:
    run = ran(tmp_path)
    assert of(run, "q")[-1] == pytest.approx(1.0, abs=2e-4)
    behind = of(run, "q")[800] - (0.8 - 0.125)  # at full rate since 0.25 s
    assert abs(behind) < 2e-3
    plain = ran(tmp_path, ("k_position = 20", "feed_forward = 0;  k_position = 20"))
    # without feed-forward it lags by the rate over the gain
    assert of(plain, "q")[800] - (0.8 - 0.125) == pytest.approx(-1.0 / 20.0, rel=0.05)


def test_current_and_voltage_keep_to_their_limits_and_integrals_do_not_wind_up(tmp_path: Path) -> None:
    far = ("position(trapezoid(to = 1 rad, max_rate = 1 rad/s, max_acceleration = 4 rad/s^2))", "rate(3 rad/s)")
    limited = ran(tmp_path, far, ("kp = 1 A", "i_max = 3 A;  v_max = 10 V;  kp = 1 A"))
    assert np.abs(of(limited, "servo.current_cmd")).max() == 3.0
    assert np.abs(of(limited, "servo.voltage")).max() == 10.0
    # 10 V turn the motor no faster than 200 rad/s: the rate asked is never reached, and the integral stands
    assert of(limited, "qd")[-1] < 2.0
    assert (np.diff(of(limited, "servo.integral"))[50:] == 0.0).all()


@pytest.mark.slow
def test_a_gear_that_is_stiff_moves_as_a_rigid_one(tmp_path: Path) -> None:
    rigid = ran(tmp_path, ("stiffness = 20000 N*m/rad;  damping = 20 N*m*s/rad;", "gear = rigid;"))
    away = []
    for stiffness in ("2e4", "8e4"):
        elastic = ran(tmp_path, ("stiffness = 20000", f"stiffness = {stiffness}"))
        away.append(np.abs(of(elastic, "q") - of(rigid, "q")).max())
    assert away[1] < 5e-4 and away[0] / away[1] == pytest.approx(4.0, rel=0.3), "as the compliance"


@pytest.mark.slow
def test_sampled_loops_come_to_the_continuous_ones(tmp_path: Path) -> None:
    smooth = (
        "trapezoid(to = 1 rad, max_rate = 1 rad/s, max_acceleration = 4 rad/s^2)",
        "sine(amplitude = 0.1 rad, frequency = 1 Hz)",
    )
    analog = ran(tmp_path, smooth)
    away = []
    for rate in ("500 Hz", "1 kHz", "2 kHz"):
        sampled = ran(tmp_path, smooth, ("rate = continuous", f"rate = {rate}"))
        away.append(np.abs(of(sampled, "q") - of(analog, "q")).max())
    assert away[0] / away[1] == pytest.approx(2.0, rel=0.25) and away[1] / away[2] == pytest.approx(2.0, rel=0.25), away


def test_a_torque_command_asks_for_its_current(tmp_path: Path) -> None:
    command = ("position(trapezoid(to = 1 rad, max_rate = 1 rad/s, max_acceleration = 4 rad/s^2))", "torque(5 N*m)")
    run = ran(tmp_path, command, ("duration = 2 s", "duration = 0.5 s"))
    assert (of(run, "servo.current_cmd") == 1.0).all() and (of(run, "servo.integral") == 0.0).all()
