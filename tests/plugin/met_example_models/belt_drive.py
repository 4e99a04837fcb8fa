"""Belt drive: a motor under a rate loop with an integral, behind an elastic belt.

    e = qd_cmd - qd,  T* = kp e + ki I,  T_m = clip(T*, +-limit)        at a tick, held to the next; or continuous
    I' = e, 0 where T* is beyond the limit and e would push it further
    angle' = rate,  rate' = (T_m - T)/rotor,  T = stiffness (angle - q) + damping (rate - qd)

All of it is on the joint's side. Not a belt that slips, and the motor has no friction.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Memory, Parameter, State
from met.servos import Servo
from met.servos.servo import Control, Drive, JointMotion, Seen
from met.trace import Real, both, clip, either, sqrt, where


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The rate loop: the motor's torque, and the slope of its integral, which the engine integrates."""
    error = seen.setpoint.value - seen.qd
    wanted = p.kp * error + p.ki * held.integral
    winding_up = either(both(wanted > p.limit, error > 0.0), both(wanted < -p.limit, error < 0.0))
    return Control({"torque_cmd": clip(wanted, -p.limit, p.limit)}, slopes={"integral": where(winding_up, 0.0, error)})


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """The belt pulls the joint, and the motor back."""
    belt = p.stiffness * (states.angle - joint.q) + p.damping * (states.rate - joint.qd)
    return Drive(torque=belt, slopes={"angle": states.rate, "rate": (held.torque_cmd - belt) / p.rotor})


def begin(p: Any, q: Real, qd: Real) -> Mapping[str, Real]:
    """The motor where the joint is, and as fast: the belt is slack."""
    return {"angle": q, "rate": qd}


def full(p: Any) -> Mapping[str, Real]:
    """The law's output at full drive: `runaway` drives the motor with it."""
    return {"torque_cmd": p.limit}


def fastest(p: Any) -> Real:
    """The roots of rotor x^2 + damping x + stiffness = 0, of a joint that stands, are no larger than this, 1/s."""
    return p.damping / p.rotor + sqrt(p.stiffness / p.rotor)


SERVO = Servo(
    name="belt_drive",
    doc=__doc__,
    commands=("rate",),
    parameters=(
        Parameter(name="kp", unit="effort*s/joint", above=0.0, doc="torque per rate error"),
        Parameter(name="ki", unit="effort/joint", at_least=0.0, default=0.0, doc="torque per integral of the error"),
        Parameter(name="limit", unit="effort", above=0.0, doc="largest torque of the motor"),
        Parameter(name="rotor", unit="effort*s^2/joint", above=0.0, doc="inertia of the motor"),
        Parameter(name="stiffness", unit="effort/joint", above=0.0, doc="stiffness of the belt"),
        Parameter(name="damping", unit="effort*s/joint", at_least=0.0, default=0.0, doc="damping of the belt"),
    ),
    outputs=(Memory(name="torque_cmd", unit="effort", doc="commanded torque of the motor"),),
    integrals=(State(name="integral", unit="joint", doc="integral of the rate error"),),
    states=(
        State(name="angle", unit="joint", doc="where the motor is"),
        State(name="rate", unit="joint/s", doc="rate of the motor"),
    ),
    control=control,
    drive=drive,
    begin=begin,
    full=full,
    fastest=fastest,
)
