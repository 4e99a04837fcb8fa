"""A servo that is to begin balanced and is too weak for it: at which load, and what is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.plan import Experiment
from tests.ic.small_decks import check, experiment, messages

LOAD = 5.0 * 9.81 * 0.3
"""N m: a level rod of 5 kg and 0.6 m on its joint."""

ARM = """\
arm level {
    link bar { mass = 5 kg; shape = rod(length = 0.6 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = -y; }
}
"""
SHAFT = "ratio = 80; resistance = 0.5 ohm; kt = 0.1 N*m/A; j_m = 6e-5 kg*m^2; command = rate(0 rad/s);"
LOOP = "kp = 0.05 V*s/rad; ki = 1 V/rad; v_max = {v_max} V; tau_max = {tau_max} N*m;"
ELASTIC = "stiffness = 1e4 N*m/rad; damping = 5 N*m*s/rad;"
SERVOS = {
    "rigid": f"servo drive {{ model = rigid_gearbox; {SHAFT} {LOOP} f_c = {{f_c}} N*m; }}",
    "elastic": f"servo drive {{ model = compliant_gearbox; {SHAFT} {LOOP} {ELASTIC} f_c = {{f_c}} N*m; }}",
    "cascade": f"servo drive {{ model = cascade; {SHAFT} {ELASTIC} f_c = {{f_c}} N*m; inductance = 5 mH; "
    "kp = 0.1 A*s/rad; ki = 1 A/rad; k_current = 5 V/A; ki_current = 100 V/(A*s); v_max = {v_max} V; "
    "i_max = {i_max} A; }",
    "cascade, rigid": f"servo drive {{ model = cascade; gear = rigid; {SHAFT} f_c = {{f_c}} N*m; inductance = 5 mH; "
    "kp = 0.1 A*s/rad; ki = 1 A/rad; k_current = 5 V/A; ki_current = 100 V/(A*s); v_max = {v_max} V; "
    "i_max = {i_max} A; }",
}
RUN = """
run hold {
    arm = level;  servos { hinge = drive; }  initial { servos = balanced; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates { dynamics = 10 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 0.02 s;  record = [q, qd, qdd];  metric fell = final { of = hinge.q; }
}
"""
ENOUGH = {"v_max": 48.0, "tau_max": 5.0, "i_max": 50.0, "f_c": 0.0}
NEEDED = {"tau_max": LOAD / 80.0, "i_max": LOAD / 80.0 / 0.1, "v_max": 0.5 * LOAD / 80.0 / 0.1}
"""What holds the load: of torque, current and voltage, in SI units."""


def deck(servo: str, **changed: float) -> str:
    text = SERVOS[servo]
    for name, value in (ENOUGH | changed).items():
        text = text.replace(f"{{{name}}}", repr(value))
    return ARM + text + RUN


def swept(folder: Path, servo: str, name: str, values: list[float], **changed: float) -> Experiment:
    unit = {"tau_max": "N*m", "i_max": "A", "v_max": "V"}[name]
    sweep = f"sweep some of hold {{ vary hinge.servo.{name} = {values} {unit}; }}"
    return experiment(folder, deck(servo, **changed), sweep, select=["some"])


LIMITS = [
    *((servo, name) for servo in ("rigid", "elastic") for name in ("tau_max", "v_max")),
    *((servo, name) for servo in ("cascade", "cascade, rigid") for name in ("i_max", "v_max")),
]


@pytest.mark.slow
@pytest.mark.parametrize(("servo", "name"), LIMITS)
def test_cases_fail_below_the_limit_that_holds_the_load_and_above_it_stand_still(
    servo: str, name: str, tmp_path: Path
) -> None:
    needed = NEEDED[name]
    found = engine.run(swept(tmp_path, servo, name, [0.5 * needed, 0.9999 * needed, 1.0001 * needed, 2.0 * needed]))
    assert found.status.tolist() == [engine.FAILED, engine.FAILED, engine.DONE, engine.DONE]
    assert np.isnan(found.metrics["fell"][:2]).all() and found.n_valid.tolist() == [0, 0, 3, 3]
    assert np.abs(found.signals["qdd"][2:, 0]).max() < 1e-9
    assert f"it takes {LOAD:.3g} N m, and its servo can hold {0.5 * LOAD:.3g} N m. `{name}`, " in found.cause[0]


STEADY = [each for each in LIMITS if each[1] != "v_max" or not each[0].startswith("cascade")]
"""All but those where an amplifier's voltage limits: there the current falls from the start on, and is not balanced."""


@pytest.mark.release
@pytest.mark.parametrize(("servo", "name"), STEADY)
def test_dry_friction_at_the_motor_holds_its_share(servo: str, name: str, tmp_path: Path) -> None:
    """A motor of 90 % of the torque, and friction of 11 or 9 % of it: the joint stays, or falls."""
    for f_c, status in ((0.11 * LOAD / 80.0, engine.DONE), (0.09 * LOAD / 80.0, engine.FAILED)):
        found = engine.run(swept(tmp_path, servo, name, [0.9 * NEEDED[name]], f_c=f_c))
        assert found.status.tolist() == [status]
        if status == engine.DONE:
            assert np.abs(found.signals["qdd"][0, 0]).max() < 1e-9


def test_a_servo_that_is_too_weak_is_an_error_where_nothing_varies(tmp_path: Path) -> None:
    said = messages(check(tmp_path, deck("rigid", tau_max=0.05)))
    column = deck("rigid", tau_max=0.05).splitlines()[4].index("0.05 N*m;") + 1
    assert (
        said
        == f"""\
error[D343]: joint `hinge` cannot begin balanced: it takes 14.7 N m, and its servo can hold 4 N m
 --> deck.ic:5:{column}
  |
5 | ...ki = 1 V/rad; v_max = 48.0 V; tau_max = 0.05 N*m; f_c = 0.0 N*m; }}
  |                                            ^^^^^^^^
 ::: deck.ic:7:28  drives joint `hinge`
  = help: `tau_max`, 0.05 N*m, is too little: raise it or the gear's ratio, or lighten what the joint carries
  = help: or let the servos begin unloaded: without `servos = balanced` the arm sinks in

1 error
"""
    )


def test_an_integral_without_gain_holds_nothing(tmp_path: Path) -> None:
    said = messages(check(tmp_path, deck("rigid").replace("ki = 1 V/rad", "ki = 0 V/rad")))
    assert "error[D343]: joint `hinge` cannot begin balanced: it takes 14.7 N m, and its servo can hold 0 N m\n" in said
    assert "help: none of its limits is in the way: an integral with a gain of 0 holds nothing; give the law an" in said


@pytest.mark.parametrize("servo", SERVOS)
def test_what_has_no_load_or_begins_unloaded_is_no_error(servo: str, tmp_path: Path) -> None:
    weak = deck(servo, tau_max=1e-3, i_max=1e-3)
    assert not check(tmp_path, weak.replace("-9.81", "0")).diagnostics
    [weakness] = check(tmp_path, weak.replace("initial { servos = balanced; }", "")).diagnostics
    assert weakness.severity == "warning" and weakness.message.startswith("`hinge.servo.")
    assert " meets a load of 14.71 N*m, " in weakness.message


def test_a_torque_command_decides_by_itself(tmp_path: Path) -> None:
    assert not check(tmp_path, deck("rigid").replace("rate(0 rad/s)", "torque(1 N*m)")).diagnostics


def test_a_joint_that_turns_is_judged_at_its_rate(tmp_path: Path) -> None:
    """At 0.5 rad/s the motor's back-EMF, 4 V, is more than what 3 V leave for the load."""
    turning = deck("rigid", v_max=6.0).replace("initial {", "initial { qd = [0.5] rad/s;")
    assert not check(tmp_path, turning).diagnostics
    said = messages(check(tmp_path, turning.replace("v_max = 6.0 V", f"v_max = {4.0 + 0.5 * NEEDED['v_max']} V")))
    assert f"it takes 14.7 N m, and its servo can hold {0.5 * LOAD:.3g} N m" in said


@pytest.mark.release
@pytest.mark.parametrize(("servo", "name"), LIMITS)
def test_many_cases_are_told_what_each_would_be_alone(servo: str, name: str, tmp_path: Path) -> None:
    """Their servos are judged together; the last can hold its joint."""
    values = [share * NEEDED[name] for share in (0.1, 0.35, 0.6, 0.99, 1.5)]
    made = swept(tmp_path, servo, name, values)
    together = engine.run(made)
    alone = [engine.run(made, [case]).cause[0] for case in range(len(values))]
    assert together.cause == alone and len(set(alone)) == len(values) and not alone[-1]
    for value, cause in zip(values[:-1], alone, strict=False):
        assert f"`{name}`, {value:.3g} " in cause
