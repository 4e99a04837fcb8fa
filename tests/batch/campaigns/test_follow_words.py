"""Joints and guided points that do not follow their command: told once of a campaign, with the remedy (D348)."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from batch.campaigns.campaign import prepare
from batch.campaigns.performing import perform
from batch.executors.threads import Threads
from met.diagnostic import Diagnostic

DECK = """\
arm one {
    link bar { mass = 6 kg;  shape = rod(length = 0.7 m, along = x); }
    joint j revolute { parent = base;  child = bar;  axis = -y; }
}
servo motor {
    model = rigid_gearbox;  kp = 0.05 V*s/rad;  ki = 1 V/rad;  v_max = 48 V;  resistance = 0.5 ohm;  kt = 0.1 N*m/A;
    tau_max = 1.2 N*m;  j_m = 6e-5 kg*m^2;  f_c = 0.01 N*m;  ratio = 100;  k_position = 10 1/s;
}
servo slow { model = ideal;  bandwidth = 0.4 1/s;  command = position(step(to = 1 rad, at = 0.1 s)); }
run move {
    arm = one;  servos { j = motor { command = position(step(to = 1 rad, at = 0.1 s)); } }
    rates { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }  duration = 3 s;  record = [q];
}
run parked like move { environment { parking = brake { joint = j;  torque = 500 N*m; } } }
run allowed like parked { allow D348 because "the brake is tried"; }
run geared like move { servos { j { f_c = 0 N*m;  ratio = 0.01; } } }
run hanging like move {
    servos { j { tau_max = 0.1 N*m;  command = position(0 rad); } }  environment { gravity = [0, 0, -9.81] m/s^2; }
}
run heavy like move { servos { j { j_m = 0.6 kg*m^2;  command = rate(0.5 rad/s); } } }
run sagging like move { servos { j { ki = 0 V/rad; } }  environment { gravity = [0, 0, -9.81] m/s^2; } }
run on_its_way like move { servos { j = slow; } }
run late like parked { servos { j { command = position(step(to = 1 rad, at = 2.9 s)); } } }
run swinging like parked { servos { j { command = position(sine(amplitude = 1 rad, frequency = 2 Hz)); } } }
run pushed like parked { servos { j { command = torque(1 N*m); } } }
run fastest like move {
    servos { j { command = rate(20 rad/s); } }  metric top = max { of = j.qd; }  require top > 4.5 rad/s;
}
run soft like move {
    servos { j { model = compliant_gearbox;  stiffness = 300 N*m/rad;  damping = 2 N*m*s/rad;
                 command = position(0 rad); } }
    environment { gravity = [0, 0, -9.81] m/s^2; }
}
run let_go like hanging { environment { broken = free_swinging { joint = j;  from = 0.5 s; } } }
sweep brakes of parked { vary environment.parking.torque = [0, 10, 500, 600] N*m; }
"""

GUIDED = """\
arm planar {
    link upper { mass = 4 kg;  shape = rod(length = 0.5 m, along = x); }
    link lower { mass = 3 kg;  shape = rod(length = 0.5 m, along = x); }
    joint one revolute { parent = base;   child = upper;  axis = z; }
    joint two revolute { parent = upper;  child = lower;  axis = z;  at = [0.5, 0, 0] m; }
}
servo exact { model = ideal;  bandwidth = 50 1/s;  command = position(pen); }
run draw {
    arm = planar;  servos { one = exact;  two = exact; }  initial { one.q = -30 deg;  two.q = 80 deg; }
    guide pen = resolved_rate {
        link = lower;  point = [0.5, 0, 0] m;  guides = xy;  max_damping = 0.1 m;  threshold = 0.1 m;  gain = 2 1/s;
        rate = 100 Hz;  max_rate = 2 rad/s;  x = trapezoid(to = WAY, max_rate = 50 cm/s, max_acceleration = 1 m/s^2);
    }
    rates { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }  duration = 5 s;  record = [q];
}
"""


def warned(folder: Path, name: str, deck: str = DECK) -> list[Diagnostic]:
    plan = ic.compile(text=deck, select=[name])
    return list(perform(prepare(plan, output=folder / f"{name}.h5", verify="none"), executor=Threads(1)).warned)


@pytest.mark.slow
def test_a_joint_that_its_brake_holds_is_told_with_the_limit_and_the_brake(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "parked")
    assert (found.code, found.severity) == ("D348", "warning")
    assert found.message == (
        "joint `j` does not follow its command: it is 1 rad off, of 1 rad that it is told to move, and "
        "`j.servo.tau_max` was reached for most of that time"
    )
    assert found.at is not None and found.at.place.line == 11
    assert found.help == (
        "raise `j.servo.tau_max`, give it less to move, or take away what holds it: `parking`",
        "root mean square from 2.25 s to 2.914 s, and it does not fall",
    )
    assert warned(tmp_path, "allowed") == []


@pytest.mark.slow
def test_an_unstable_loop_is_told_alone(tmp_path: Path) -> None:
    deck = DECK.replace("servos = 500 Hz", "servos = 50 Hz").replace("kp = 0.05 V*s/rad", "kp = 0.5 V*s/rad")
    assert "D320" in {each.code for each in ic.check(text=deck).diagnostics}
    assert warned(tmp_path, "move", deck) == []


def test_without_a_limit_the_servo_and_its_load_are_named(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "geared")
    assert found.message.endswith("of 1 rad that it is told to move")
    assert found.help[0] == "look at its servo's gains, ratio and friction, and at what it has to move"


@pytest.mark.slow
def test_a_joint_that_falls_though_it_is_told_to_stay_is_told(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "hanging")
    assert "rad off, and is told to stay, and `j.servo.tau_max` was reached" in found.message


@pytest.mark.slow
def test_a_rate_that_is_not_come_to_within_the_run_is_told(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "heavy")
    assert " rad/s off, of 0.5 rad/s that it is told, and `j.servo.tau_max`" in found.message


@pytest.mark.release
@pytest.mark.parametrize(
    "name", ["move", "sagging", "on_its_way", "late", "swinging", "pushed", "let_go", "fastest", "soft"]
)
def test_who_follows_comes_nearer_or_is_not_told_to_is_left_alone(tmp_path: Path, name: str) -> None:
    assert warned(tmp_path, name) == []


def test_of_a_sweep_the_case_that_is_furthest_off_is_named_once(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "brakes")
    assert found.message.startswith("joint `j` does not follow its command in case #2: it is 1 rad off")


@pytest.mark.slow
def test_a_path_beyond_the_reach_is_told_of_its_guide_and_not_of_its_joints(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "draw", GUIDED.replace("WAY", "180 cm"))
    assert found.message == "path of guide `pen` is not followed: it is 1.556 m off, of 1.8 m that it leads"
    assert found.at is not None and found.at.place.line == 10
    assert found.help[0] == "let the path stay where the arm reaches, and within what rates and damping leave"
    assert warned(tmp_path, "draw", GUIDED.replace("WAY", "20 cm")) == []
