"""What is stable at the dynamics' step and what is not: laws with integrals, filters of sensors, gears that swing."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from ic.meaning.checks.swings import growth
from met import models
from met import run as engine
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, shown

ANALOG = changed(RUN, ("servos = 1 kHz", "servos = continuous"))


def test_the_integral_of_a_law_that_is_continuous_is_in_its_figure(tmp_path: Path) -> None:
    """Of s^2 + 75 s + 8e6: two roots of size sqrt(8e6) = 2828 1/s."""
    stiff = changed(SERVO, ("ki = 1 V/rad", "ki = 16e3 V/rad"))
    assert (
        shown(tmp_path, ARM, stiff, ANALOG)
        == """\
error[D104]: servo `drive` is unstable with modified_euler at this rate of the dynamics
  --> deck.ic:14:24
   |
14 |     rates { dynamics = 1 kHz; servos = continuous; record = 100 Hz; }
   |                        ^^^^^ h * lambda = 2.83; the slowest rate that fits is 2000 Hz
   = help: h * lambda must stay below 2; lambda is the servo's fastest rate constant, on any arm
"""
    )
    assert "D104" not in shown(tmp_path, ARM, stiff, RUN), "of a law that ticks, the step does not see its gains"


CASCADE = """\
servo drive {
    model = cascade;  gear = rigid;  ratio = 100;  kp = 0.01 A*s/rad;  ki = 900 A/rad;  resistance = 1 ohm;
    kt = 0.05 N*m/A;  j_m = 1e-5 kg*m^2;  inductance = 10 mH;  ki_current = 100 V/(A*s);
    command = rate(0.1 rad/s);
}
"""


def test_so_is_that_of_a_cascades_rate_loop(tmp_path: Path) -> None:
    """sqrt(Kt Ki/J_m) = sqrt(0.05 900/1e-5) = 2121 1/s; the current loop's own is 100 1/s."""
    said = shown(tmp_path, ARM, CASCADE, ANALOG)
    assert said.startswith("error[D104]") and "h * lambda = 2.12; " in said


FILTERED = changed(
    SERVO, ("command", "sensor qd = tachometer { filter = butterworth;  cutoff = CUTOFF; }\n    command")
)


def test_the_filter_of_a_sensor_is_held_to_the_step(tmp_path: Path) -> None:
    fast = changed(FILTERED, ("CUTOFF", "700 Hz"))
    assert (
        shown(tmp_path, ARM, fast, RUN)
        == """\
error[D104]: sensor `qd` of servo `drive` is unstable with modified_euler at this rate of the dynamics
  --> deck.ic:15:24
   |
15 |     rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
   |                        ^^^^^ h * lambda = 4.4; the slowest rate that fits is 3000 Hz
   = help: h * lambda must stay below 2; lambda is the rate constant of the sensor's filter, 2 pi cutoff
"""
    )
    slower = changed(FILTERED, ("CUTOFF", "100 Hz"))
    assert (
        shown(tmp_path, ARM, slower, RUN)
        == """\
warning[D105]: sensor `qd` of servo `drive` is fast for the dynamics' step: h * lambda = 0.628
  --> deck.ic:15:24
   |
15 |     rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
   |                        ^^^^^ h = 0.001 s
   = help: stable below 2 with modified_euler, true to the motion below 0.5: the slowest rate that fits is 2000 Hz
"""
    )


@pytest.mark.parametrize(("sensor", "said"), [
    ("tachometer { filter = butterworth;  cutoff = 50 Hz; }", []), ("tachometer { noise = 0.1 rad/s; }", []),
    ("low_pass { cutoff = 50 Hz; }", []), ("low_pass { cutoff = 400 Hz; }", ["D104"]),
])  # fmt: skip
def test_one_that_the_step_follows_is_not_told(sensor: str, said: list[str], tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, changed(SERVO, ("command", f"sensor qd = {sensor}\n    command")), RUN) == said


def test_a_filter_that_swings_is_unstable_sooner_with_semi_implicit_euler(tmp_path: Path) -> None:
    """Its roots are at 45 degrees: explicit Euler of them is stable below h w = sqrt(2), and 1.5 is below the 2 of D104."""
    deck = changed(FILTERED, ("CUTOFF", f"{1.5e3 / (2.0 * math.pi)} Hz"))
    run = changed(RUN, ("    duration", "    integrator = semi_implicit_euler;\n    duration"))
    assert codes(tmp_path, ARM, deck, run) == ["D105", "D249"]
    less = changed(FILTERED, ("CUTOFF", f"{1.4e3 / (2.0 * math.pi)} Hz"))
    assert codes(tmp_path, ARM, less, run) == ["D105"]


GEAR = """\
arm swing {
    link bar { mass = 2 kg;  com = [0, 0, 0] m;  inertia = [HEAVY, HEAVY, HEAVY] kg*m^2; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo drive {
    model = compliant_gearbox;
    ratio = 100;  kp = 0 V*s/rad;  ki = 0 V/rad;  v_max = 1e9 V;  resistance = 1e6 ohm;  kt = 0.05 N*m/A;
    tau_max = 1 N*m;  j_m = 1e-5 kg*m^2;  stiffness = 2000 N*m/rad;
    command = torque(1 N*m);
}
run hold {
    arm = swing;
    servos { hinge = drive; }
    integrator = modified_euler;
    rates { dynamics = 300 Hz;  servos = 300 Hz; }
    duration = 4 s;
    record = [servo.deflection];
}
"""


def test_a_gear_that_a_step_makes_swing_up_is_told(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, GEAR.replace("HEAVY", "1e6"))
        == """\
warning[D249]: the gear of servo `drive` swings, and this step of modified_euler makes that grow: by e in every 0.543 s
  --> deck.ic:15:24
   |
15 |     rates { dynamics = 300 Hz;  servos = 300 Hz; }
   |                        ^^^^^^ h = 0.00333333 s
   = help: the slowest rate at which it does not: 1500 Hz
   = help: at this rate it does not with: `integrator = rk4;`
   = help: or damp it: of x'' = -a x - b x', b is 0 1/s, and 3.31 1/s would do
   = help: reckoned with the joint held: a gear swings faster against a light one
"""
    )


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "hz"), [
    ("modified_euler", 300), ("modified_euler", 400), ("midpoint", 300), ("semi_implicit_euler", 2000),
])  # fmt: skip
def test_the_growth_that_is_told_is_the_growth_of_a_run(integrator: str, hz: int, tmp_path: Path) -> None:
    """Against an arm so heavy that it stands still, the winding swings about what the torque holds."""
    deck = changed(
        GEAR,
        ("modified_euler", integrator),
        ("dynamics = 300 Hz;  servos = 300 Hz", f"dynamics = {hz} Hz;  servos = {hz} Hz"),
    ).replace("HEAVY", "1e6")
    run = engine.run(experiment(tmp_path, deck))
    winding = run.signals["servo.deflection"][0, :, 0] - 1.0 / 2000.0
    size = [np.abs(part).max() for part in np.array_split(winding, 4)]
    a = 2000.0 / (1e4 * 1e-5)
    predicted = float(growth(models.find("integrator", integrator), 1.0 / hz, a, 0.0)) * hz  # ln a second
    np.testing.assert_allclose(np.log(size[3] / size[1]) / 2.0, predicted, rtol=0.02)
    assert predicted > 0.1 and "D249" in codes(tmp_path, deck)


@pytest.mark.parametrize(("change", "said"), [
    (("integrator = modified_euler", "integrator = rk4"), []),
    (("dynamics = 300 Hz;  servos = 300 Hz", "dynamics = 500 Hz;  servos = 250 Hz"), ["D249"]),
    (("dynamics = 300 Hz;  servos = 300 Hz", "dynamics = 1500 Hz;  servos = 300 Hz"), []),
    (("stiffness = 2000 N*m/rad", "stiffness = 2000 N*m/rad;  damping = 2 N*m*s/rad"), []),
    (("duration = 4 s", "duration = 0.04 s"), []),
    (("torque(1 N*m)", "rate(1 rad/s)"), ["D249"]),
    (("ki = 0 V/rad", "ki = 0 V/rad;  f_v = 2e-4 N*m*s/rad"), []),
])  # fmt: skip
def test_what_helps_is_not_told(change: tuple[str, str], said: list[str], tmp_path: Path) -> None:
    assert codes(tmp_path, changed(GEAR, change).replace("HEAVY", "1e6")) == said


def test_the_worst_case_of_a_sweep_is_told(tmp_path: Path) -> None:
    sweep = (
        "sweep gears of hold { vary drive.stiffness = [1000, 2000] N*m/rad;  vary drive.damping = [0, 5] N*m*s/rad; }\n"
    )
    (told,) = check(tmp_path, GEAR.replace("HEAVY", "1e6"), sweep, select=["gears"]).diagnostics
    a = 2000.0 / (1e4 * 1e-5)
    every = 1.0 / (300.0 * float(growth(models.find("integrator", "modified_euler"), 1.0 / 300.0, a, 0.0)))
    assert told.code == "D249" and told.message.endswith(f"by e in every {every:.3g} s")


def test_the_gain_of_a_rate_loop_brakes_the_swing_and_a_current_loop_may_swing(tmp_path: Path) -> None:
    held = changed(GEAR, ("torque(1 N*m)", "rate(1 rad/s)"), ("kp = 0 V", "kp = 1e3 V")).replace("HEAVY", "1")
    assert codes(tmp_path, held) == [], "b = Kt Kp/(R J_m) = 5 1/s"
    loop = changed(
        CASCADE, ("ki_current = 100 V", "ki_current = 5000 V"), ("resistance = 1 ohm", "resistance = 0.01 ohm")
    )
    fast, told = check(tmp_path, ARM, loop, RUN).diagnostics
    assert fast.code == "D105" and told.code == "D249"
    assert told.message.startswith("the current loop of servo `drive` swings, and this step of modified_euler")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mass", "position", "rate", "sensor"),
    [
        (1, 40, 50, ""),
        (20, 0, 100, "sensor qd = tachometer { delay = 3; }"),
    ],
)
def test_a_deck_that_takes_the_told_gains_is_stable(
    tmp_path: Path, mass: int, position: int, rate: int, sensor: str
) -> None:
    """What was found: with kp and ki rounded apart a loop at the very edge went on to grow."""
    command = "position(0 deg)" if position else "rate(0 rad/s)"
    gains = f"kp = 0.5 V*s/rad; ki = 20 V/rad; k_position = {position} 1/s; {sensor}"
    servo = changed(SERVO, ("kp = 0.1 V*s/rad; ki = 1 V/rad;", gains), ("rate(0.1 rad/s)", command))
    run = changed(RUN, ("servos = 1 kHz", f"servos = {rate} Hz"), ("record = 100 Hz", "record = 50 Hz"))
    arm = changed(ARM, ("mass = 2 kg", f"mass = {mass} kg"))
    [found] = check(tmp_path, arm, servo, run).diagnostics
    kp, ki = re.findall(r"k[pi] = \S+", str(found.help[0]))
    assert found.code == "D320"
    told = changed(servo, ("kp = 0.5", kp), ("ki = 20", ki))
    assert codes(tmp_path, arm, told, run) == []
