"""Sensors and dead sensors of what a law never reads are told, and of nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, changed, codes, shown


def sensed(servo: str, of: str) -> str:
    return changed(servo, ("command = ", f"sensor {of} = tachometer {{ delay = 1; }}\n    command = "))


def dead(of: str, run: str = RUN) -> str:
    fault = f"    environment {{ fault = dead_sensor {{ joint = hinge;  of = {of}; }} }}\n    duration"
    return changed(run, ("    duration", fault))


IDEAL = "servo drive { model = ideal;  bandwidth = 30 s^-1;  command = rate(0.1 rad/s); }\n"
POSITION = changed(SERVO, ("rate(0.1 rad/s)", "position(0.1 rad);  k_position = 2 1/s"))
TORQUE = changed(SERVO, ("rate(0.1 rad/s)", "torque(1 N*m)"))
CASCADE = """\
servo drive {
    model = cascade;  ratio = 100;  kp = 0.05 A*s/rad;  ki = 0.5 A/rad;  resistance = 1 ohm;  stiffness = 500 N*m/rad;
    kt = 0.05 N*m/A;  j_m = 1e-4 kg*m^2;  inductance = 10 mH;  ki_current = 100 V/(A*s);  damping = 5 N*m*s/rad;
    command = torque(1 N*m);
}
"""


def test_a_sensor_of_what_the_law_does_not_read_is_told(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, sensed(SERVO, "q"), RUN)
        == """\
warning[D290]: sensor `q` changes nothing: the law of servo `drive` (rigid_gearbox) does not read `q`
 --> deck.ic:9:5
  |
9 |     sensor q = tachometer { delay = 1; }
  |     ^^^^^^^^
  = help: it reads under a rate command: qd
  = help: leave it out, or record it: `record += [hinge.servo.sensor.q];`
"""
    )


def test_so_is_a_dead_one(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, IDEAL, dead("qd"))
        == """\
warning[D168]: environment `fault` never acts: the law of servo `drive` (ideal) does not read `qd`
  --> deck.ic:10:62
   |
10 |     environment { fault = dead_sensor { joint = hinge;  of = qd; } }
   |                                                              ^^
   = help: it reads nothing of its joint under a rate command
   = help: change that, or leave it out
"""
    )


@pytest.mark.slow
@pytest.mark.parametrize("run", [RUN, changed(RUN, ("servos = 1 kHz", "servos = continuous"))])
@pytest.mark.parametrize(("servo", "of", "read"), [
    (SERVO, "qd", True), (SERVO, "q", False), (POSITION, "q", True), (POSITION, "qd", True), (TORQUE, "qd", True),
    (TORQUE, "q", False), (CASCADE, "qd", False), (CASCADE, "motor_rate", False),
    (changed(CASCADE, ("torque(1 N*m)", "position(0 rad);  k_position = 2 1/s")), "q", True), (IDEAL, "q", False),
])  # fmt: skip
def test_it_is_told_where_no_output_is_made_of_it(servo: str, of: str, read: bool, run: str, tmp_path: Path) -> None:
    lag = changed(sensed(servo, of), ("tachometer { delay = 1; }", "low_pass { cutoff = 20 Hz; }"))
    said = [code for code in codes(tmp_path, ARM, lag, run) if code != "D105"]
    assert said == ([] if read else ["D290"])
    said = [code for code in codes(tmp_path, ARM, servo, dead(of, run)) if code != "D105"]
    assert said == ([] if read else ["D168"])


@pytest.mark.parametrize(
    "change",
    [
        ("record = [q]", "record = [hinge.servo.sensor.q]"),
        ("record = [q]", "record = [qd];  metric m = max { of = hinge.servo.sensor.q; }"),
    ],
)
def test_a_sensor_whose_reading_is_kept_does_something(change: tuple[str, str], tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, sensed(SERVO, "q"), changed(RUN, change)) == []


TWO = """\
arm pair {
    link boom { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    link tip { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = boom;  axis = z; }
    joint knee revolute { parent = boom;  child = tip;  at = [1, 0, 0] m;  axis = z; }
}
run both {
    arm = pair;  servos { hinge = HINGE;  knee = KNEE; }
    rates { dynamics = 1 kHz;  servos = 1 kHz; }
    duration = 1 s;  record = [q];
}
"""


POSITIONED = "drive { command = position(0.1 rad);  k_position = 2 1/s; }"


@pytest.mark.parametrize(
    ("hinge", "knee", "told"),
    [
        ("drive", "drive", ["hinge", "knee"]),
        ("drive", "drive { kp = 0.05 V*s/rad; }", ["hinge", "knee"]),
        ("drive", POSITIONED, []),  # a definition with a sensor that one of its joints needs
        (POSITIONED, "drive", []),
    ],
)
def test_of_two_joints_with_one_servo_one_that_reads_it_is_enough(
    hinge: str, knee: str, told: list[str], tmp_path: Path
) -> None:
    said = shown(tmp_path, sensed(SERVO, "q"), changed(TWO, ("HINGE", hinge), ("KNEE", knee)))
    assert [joint for joint in ("hinge", "knee") if f"[{joint}.servo.sensor.q]" in said] == told
    assert said.count("D290") == len(told)
