"""Share of a run's time at limits, against closed forms; which limit is reached at a required metric's extreme."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.plan.limits import extremes
from tests.ic.small_decks import experiment

ARM = """\
arm bar {
    link boom { mass = 3 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = boom; axis = z; }
}
servo drive {
    model = rigid_gearbox;  ratio = 10;  kp = 1 V*s/rad;  ki = 0 V/rad;  v_max = 1000 V;  resistance = 1 ohm;
    kt = 0.1 N*m/A;  tau_max = 1000 N*m;  j_m = 0.01 kg*m^2;
}
"""
"""J = 1 kg m^2 of the rod about its end, and as much of the rotor."""

RUN = """
run it {{
    arm = bar;  {of}
    rates {{ dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }}
    duration = 2 s;  record = [q, qd];  {more}
}}
"""


def deck(of: str, more: str = "", arm: str = ARM) -> str:
    return arm + RUN.format(of=of, more=more)


def test_a_motor_that_is_asked_more_than_its_torque_from_a_quarter_on_is_there_for_three_quarters(
    tmp_path: Path,
) -> None:
    """A torque command's torque is had at any rate, and 10 N m at the joint are 1 N m at the motor."""
    asked = "servos { hinge = drive { tau_max = 0.5 N*m;  command = torque(step(to = 10 N*m, at = 0.5 s)); } }"
    found = engine.run(experiment(tmp_path, deck(asked)))
    assert found.at_limit["hinge.servo.tau_max"].tolist() == [0.75]
    assert found.at_limit["hinge.servo.v_max"].tolist() == [0.0]


def test_a_drive_is_at_its_voltage_until_the_back_emf_lets_the_rate_come_near(tmp_path: Path) -> None:
    """J w' = kt/R (V - kt w) N^2 with both inertias until kp (N r - N qd) = V: a first-order rise, at the shaft."""
    asked = "servos { hinge = drive { v_max = 40 V;  command = rate(10 rad/s); } }"
    found = engine.run(experiment(tmp_path, deck(asked)))
    constant = 2.0 / (0.1**2 * 10.0**2)  # s: (J + N^2 J_m) R/(N kt)^2
    reached = (10.0 * 10.0 - 40.0) / 10.0  # rad/s: where N (r - qd) kp is 40 V
    until = -constant * np.log(1.0 - reached * 10.0 * 0.1 / 40.0)
    assert found.at_limit["hinge.servo.v_max"][0] * 2.0 == pytest.approx(until, abs=0.001)  # the step it falls in
    assert 0.1 < until < 1.0


def test_a_joint_is_at_its_stop_for_half_a_swing_of_the_stops_spring(tmp_path: Path) -> None:
    stopped = "initial { hinge.qd = 1 rad/s; }  environment { end = joint_stop { joint = hinge;  upper = 0.5 rad;"
    found = engine.run(experiment(tmp_path, deck(f"{stopped} stiffness = 400 N*m/rad; }} }}")))
    assert list(found.at_limit) == ["environment.end.upper"]  # no lower end was written
    # from the first step that begins beyond the end, to the first that begins before it
    assert found.at_limit["environment.end.upper"][0] * 2.0 == pytest.approx(np.pi * np.sqrt(1.0 / 400.0), abs=0.001)


def test_tables_end(tmp_path: Path) -> None:
    asked = "servos { hinge = drive { command = position(table(times = [0, 0.5] s, values = [0, 1] deg)); } }"
    pushed = "environment { push = wrench_table { link = boom;  times = [0.3, 1.8] s;  force_y = [1, 1] N; } }"
    found = engine.run(experiment(tmp_path, deck(asked.replace("drive {", "drive { k_position = 1 1/s; ") + pushed)))
    assert found.at_limit["hinge.servo.command.times"].tolist() == [0.75]
    assert found.at_limit["environment.push.times"][0] == pytest.approx(0.25, abs=1e-12)


@pytest.mark.slow
def test_an_attitude_hold_is_at_its_limit_while_it_wants_more(tmp_path: Path) -> None:
    """From 1 rad off it wants 4 N m/rad 2 sin(phi/2), so 1 N m until phi is 2 asin(1/8): at 0.5 rad/s^2 for
    sqrt(2 (1 - phi)/0.5) s."""
    body = """\
    arm ship {
        link base { mass = 5 kg; inertia = [2, 2, 2] kg*m^2; }
        link mast { mass = 1e-9 kg; inertia = [1e-9, 1e-9, 1e-9] kg*m^2; }
        joint held revolute { parent = base; child = mast; axis = z; }
    }
    run it {
        arm = ship;  base = free;  initial { base.rpy = [0, 0, 1] rad; }
        environment { hold = attitude_hold { stiffness = [0, 0, 4] N*m/rad;  limit = [9, 9, 1] N*m; } }
        rates { dynamics = 1 kHz;  record = 100 Hz; }  duration = 2 s;  record = [q];
    }
    """
    found = engine.run(experiment(tmp_path, body))
    assert found.at_limit["environment.hold.limit.x"].tolist() == [0.0]
    until = np.sqrt(2.0 * (1.0 - 2.0 * np.arcsin(1.0 / 8.0)) / 0.5)
    assert found.at_limit["environment.hold.limit.z"][0] * 2.0 == pytest.approx(until, abs=0.001)


def test_each_case_of_a_sweep_has_its_own_share_and_a_limit_that_no_case_has_is_none(tmp_path: Path) -> None:
    asked = "servos { hinge = drive { command = torque(10 N*m); } }"
    swept = deck(asked) + "sweep many of it { vary hinge.servo.tau_max = [0.5, 2] N*m; }"
    found = engine.run(experiment(tmp_path, swept, select=["many"]))
    assert found.at_limit["hinge.servo.tau_max"].tolist() == [1.0, 0.0]
    free = engine.run(experiment(tmp_path, deck("")))
    assert free.at_limit == {} and free.extreme_at == {}


@pytest.mark.parametrize(
    ("metric", "limit", "at"),
    [("peak { of = hinge.qd; }", "< 100 rad/s", ""), ("max { of = hinge.tau; }", "< 100 N*m", "hinge.servo.tau_max")],
)
def test_the_limit_at_an_extreme_is_the_one_that_was_reached_when_it_fell(
    tmp_path: Path, metric: str, limit: str, at: str
) -> None:
    """The motor is at its torque for 0.5 s. The torque is then as large as it is ever; the rate goes on to rise."""
    asked = "servos { hinge = drive { tau_max = 0.5 N*m;  command = torque(table(times = [0, 0.5, 0.501, 2] s,"
    asked += " values = [10, 10, 1, 1] N*m)); } }"
    of = experiment(tmp_path, deck(asked, f"metric most = {metric}  require most {limit};"))
    found = engine.run(of)
    uses = extremes(of)["most"]
    number = int(found.extreme_at["most"][0])
    assert (uses[number - 1].path if number else "") == at


def test_limits_change_no_bit_of_the_motion_and_no_key_of_it(tmp_path: Path) -> None:
    asked = "servos { hinge = drive { tau_max = 0.5 N*m;  command = rate(5 rad/s); } }"
    required = "metric most = max { of = hinge.qd; }"
    plain = engine.prepare(experiment(tmp_path, deck(asked, required)))
    judged = engine.prepare(experiment(tmp_path, deck(asked, required + "  require most < 9 rad/s;")))
    assert plain.code_key == judged.code_key and plain.result_keys == judged.result_keys
    one, other = engine.run(plain), engine.run(judged)
    assert one.signals["q"].tobytes() == other.signals["q"].tobytes()
    assert one.metrics["most"].tobytes() == other.metrics["most"].tobytes()
    assert list(one.extreme_at) == [] and list(other.extreme_at) == ["most"]


def test_a_failed_case_has_no_share(tmp_path: Path) -> None:
    asked = "servos { hinge = drive { command = rate(5 rad/s); } } environment { drag = joint_damping { damping = "
    failed = engine.run(experiment(tmp_path, deck(f"{asked} 1e7 N*m*s/rad; }} }} initial {{ hinge.qd = 1 rad/s; }}")))
    assert failed.status.tolist() == [engine.FAILED]
    assert np.isnan(failed.at_limit["hinge.servo.v_max"]).all()
