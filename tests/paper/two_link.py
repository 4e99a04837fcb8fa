"""The paper's arm as a deck, at any rates, for the tests and figures here, and its answer from the oracle."""

from __future__ import annotations

import math

import ic
from met import run as engine
from met.plan import Experiment

SLOW = 0.03  # rad/s, the rate that the paper commands to both joints
RATIO = 1570.0  # of the gearbox, table 1
DRY = 0.0205 * RATIO  # Coulomb friction of table 1 at the joint, N m
ONCE_A_TURN = RATIO * SLOW / (2.0 * math.pi)  # turns of the motor's shaft a second at that rate, 7.5 Hz


def experiment(
    *,
    dynamics_hz: float = 25.0,
    servo_hz: float = 100.0,
    record_hz: float | None = None,
    duration: float = 20.0,
    command: str = "rate(slow)",
    friction: bool = True,
    run: str = "",
) -> Experiment:
    """`run nominal` of the deck two_link.ic with these changes; `run` is more of the run's body.

    friction=False takes dry and viscous friction away.
    """
    smooth = "" if friction else "f_c = 0 N*m; f_v = 0 N*m*s/rad;"
    base = max(dynamics_hz, servo_hz)
    text = f"""
        #include <two_link.ic>
        servo told like gearbox {{ command = {command}; {smooth} }}
        run changed like nominal {{
            servos      {{ shoulder = told; elbow = told; }}
            rates       {{ base = {base} Hz; dynamics = {dynamics_hz} Hz; servos = {servo_hz} Hz;
                           record = {record_hz or dynamics_hz} Hz; }}
            duration    = {duration} s;
            record      = [q, qd, tau, servo.voltage];
            {run}
        }}
    """
    return ic.compile(text=text, select=["changed"]).experiments[0]


def run(**changes: object) -> engine.Run:
    """The one case of `experiment(**changes)`, run."""
    result = engine.run(experiment(**changes))  # type: ignore[arg-type]
    assert result.cause == [""], result.cause
    return result


def hybrid(faults: str = "typical", **changes: object) -> engine.Run:
    """The same with the shoulder's motor on an emulated bed; `faults` is the bed's parameter, and others if need be."""
    body = f"""
        substitute shoulder {{ bed = emulated(faults = {faults});  law = velocity_tracking; }}
        record += [qdd, shoulder.bed.shaft_rate];
    """
    return run(run=body, **changes)
