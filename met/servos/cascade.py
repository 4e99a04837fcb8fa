"""Cascaded servo, as robots have: a position loop around a rate loop around a current loop, with feed-forward.

    u = feed_forward N r' + k_position (N r - theta) - w      position command r, with its rate r'
    u = N r - w                                               rate command r
    i* = Kp u + Ki I,  i_cmd = clip(i*, +-i_max)              at a tick, held to the next; or continuous
    dI/dt = u, 0 where i* is beyond the limit and u would push it further; I+ = I + T dI/dt at a tick
    V = clip(k_current e + A, +-v_max),  e = i_cmd - i        the amplifier, always analog
    dA/dt = ki_current e, 0 where V is at its limit and e would push it further
    L di/dt = V - R i - Kt w,  tau_m = Kt i                   the armature, with its inductance
    J_m w' = tau_m - T/N - friction                           gear = elastic: motor and joint are two inertias, as in
                                                              compliant_gearbox
    tau = N (tau_m - friction), and N^2 J_m moves with q      gear = rigid: w = N q', theta = N q

A torque command sets i* = r/(N Kt), open loop. theta and w are the angle and rate of the motor: the loops see its
encoder and tachometer.

The current loop is fast: ki_current/R or sqrt(ki_current/L) often needs a step of the dynamics below 0.1 ms. If the
current loop does not matter, use `rigid_gearbox` or `compliant_gearbox`, which have an armature without inductance, and
a voltage.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from met.parameter import Memory, Parameter, Signal, State
from met.servos import compliant_gearbox, gear, rate_loop
from met.servos.compliant_gearbox import JOINT_FRICTION, geared
from met.servos.friction import BRISTLE, LOSS, SHAFT, friction, steady
from met.servos.friction import PARAMETERS as FRICTION
from met.servos.motor import ARMATURE, RATIO
from met.servos.servo import Control, Drive, JointMotion, Seen, Servo, Setpoint
from met.trace import Real, both, clip, either, maximum, sign, sqrt, where

ELASTIC = ("gear", ("elastic",))


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The position and rate loop: computes the current to be driven."""
    if seen.setpoint.kind == "torque":
        current = seen.setpoint.value / (p.ratio * p.kt)
        return Control({"current_cmd": clip(current, -p.i_max, p.i_max)}, {"integral": 0.0})
    error = _error(p, seen.setpoint, seen.q, seen.qd)
    wanted = p.kp * error + p.ki * held.integral
    return Control({"current_cmd": clip(wanted, -p.i_max, p.i_max)}, {"integral": _within(error, wanted, p.i_max)})


def _error(p: Any, setpoint: Setpoint, q: Real, qd: Real) -> Real:
    """Error of the motor's rate, rad/s; q, qd: its angle and rate over the ratio."""
    rate = p.ratio * setpoint.value
    if setpoint.kind == "position":
        rate = p.feed_forward * (p.ratio * setpoint.slope) + p.k_position * (p.ratio * (setpoint.value - q))
    return rate - p.ratio * qd


def measured(p: Any, q: Real, qd: Real, states: Any) -> tuple[Real, Real]:
    """The motor's angle and rate over the ratio: the loops see its encoder and tachometer."""
    return compliant_gearbox.measured(p, q, qd, states) if p.gear == "elastic" else (q, qd)


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """Amplifier, armature, motor and gear, under the current asked."""
    elastic = p.gear == "elastic"
    w = states.motor_rate if elastic else p.ratio * joint.qd
    error = held.current_cmd - states.current
    wanted = p.k_current * error + states.amplifier
    voltage = clip(wanted, -p.v_max, p.v_max)
    electric = {
        "current": (voltage - p.resistance * states.current - p.kt * w) / p.inductance,
        "amplifier": p.ki_current * _within(error, wanted, p.v_max),
    }
    tau_m = p.kt * states.current
    signals = {"voltage": voltage, "motor_torque": tau_m}
    if elastic:
        moved = geared(p, states, joint, tau_m, p.kt * p.i_max, signals)
        return replace(moved, slopes={**electric, **moved.slopes})
    drag = friction(p, w, states)
    return Drive(
        torque=p.ratio * (tau_m - drag.torque) - p.f_v_joint * joint.qd,
        dry=p.ratio * drag.level + p.f_c_joint,
        rotor=p.ratio * p.ratio * p.j_m,
        spin=p.ratio * p.j_m,
        slopes={**electric, **drag.bending},
        signals=signals,
        state_out_of_range=drag.state_out_of_range,
    )


def _within(error: Real, wanted: Real, most: Real) -> Real:
    """The error that an integral takes in: none where the wanted value is beyond the limit, and the error would push it
    further."""
    return where(either(both(wanted > most, error > 0.0), both(wanted < -most, error < 0.0)), 0.0, error)


def begin(p: Any, q: Real, qd: Real) -> Mapping[str, Real]:
    """Start with no current and no stored integrals; the motor turns with the joint."""
    starts: dict[str, Real] = {"current": 0.0, "amplifier": 0.0}
    if p.gear == "elastic":
        return {**starts, **compliant_gearbox.begin(p, q, qd)}
    return starts | ({"bristle": 0.0} if p.friction == "lugre" else {})


def balance(p: Any, torque: Real, seen: Seen) -> Mapping[str, Real]:
    """The current that joint, gear and friction take, steady under the amplifier; and the integral that asks for it."""
    w = p.ratio * seen.qd
    if p.gear == "elastic":
        states, tau_m = compliant_gearbox.balanced(p, torque, seen.qd)
        at_motor = seen.q + states["deflection"]
    else:
        drag, states = steady(p, w)
        tau_m, at_motor = (torque + p.f_v_joint * seen.qd + sign(seen.qd) * p.f_c_joint) / p.ratio + drag, seen.q
    current = clip(tau_m / p.kt, -p.i_max, p.i_max)
    voltage = clip(p.resistance * current + p.kt * w, -p.v_max, p.v_max)
    torques = seen.setpoint.kind == "torque"
    integral = 0.0 if torques else rate_loop.wound(p, current, _error(p, seen.setpoint, at_motor, seen.qd))
    amplifier = where(p.ki_current > 0.0, voltage, 0.0)
    return {**states, "current": current, "amplifier": amplifier, "integral": integral}


def fastest(p: Any) -> Real:
    """The largest of the current loop's rate constants, the roots of L s^2 + (R + k_current) s + ki_current, and the
    gear's; 1/s."""
    resistance = p.resistance + p.k_current
    electric = maximum(resistance / p.inductance, sqrt(p.ki_current / p.inductance))
    if p.gear != "elastic":
        return electric
    return maximum(electric, sqrt(p.stiffness / (p.ratio * p.ratio * p.j_m)))


def fastest_law(p: Any) -> Real:
    """The larger of `fastest` and the rate loop's on the motor alone, 1/s: s^2 + (Kt Kp + F_v)/J_m s + Kt Ki/J_m."""
    return maximum(fastest(p), maximum((p.kt * p.kp + p.f_v) / p.j_m, sqrt(p.kt * p.ki / p.j_m)))


def swings(p: Any, kind: str) -> Mapping[str, tuple[Real, Real]]:
    """Oscillations of the current loop, and of the motor on its gear, damped only by the rate loop's gain: the current
    is the one commanded."""
    oscillations = {"current loop": (p.ki_current / p.inductance, (p.resistance + p.k_current) / p.inductance)}
    if p.gear == "elastic":
        oscillations["gear"] = compliant_gearbox.swing(p, 0.0 if kind == "torque" else p.kt * p.kp)
    return oscillations


def full(p: Any) -> Mapping[str, Real]:
    """The output of a servo that gives all it can: its largest current, A."""
    return {"current_cmd": p.i_max}


SERVO = Servo(
    name="cascade",
    doc=__doc__,
    commands=("position", "rate", "torque"),
    parameters=(
        RATIO,
        Parameter(
            name="k_position",
            unit="1/s",
            default=0.0,
            at_least=0.0,
            needed_for=("position",),
            doc="gain of the position loop: commanded rate per position error; used only under a position command",
        ),
        Parameter(
            name="feed_forward",
            default=1.0,
            doc="feed-forward: share of the position command's rate that is added to the commanded rate",
        ),
        Parameter(name="kp", unit="A*s/rad", at_least=0.0, doc="proportional gain Kp on the error of the motor's rate"),
        Parameter(name="ki", unit="A/rad", at_least=0.0, doc="integral gain Ki on the error of the motor's rate"),
        Parameter(
            name="i_max", unit="A", default=math.inf, above=0.0, doc="largest current that the control law commands"
        ),
        Parameter(name="k_current", unit="V/A", default=0.0, at_least=0.0, doc="proportional gain of the current loop"),
        Parameter(name="ki_current", unit="V/(A*s)", at_least=0.0, doc="integral gain of the current loop"),
        Parameter(name="v_max", unit="V", default=math.inf, above=0.0, doc="largest voltage of the amplifier"),
        *ARMATURE,
        Parameter(name="inductance", unit="H", above=0.0, doc="armature inductance L"),
        *SHAFT,
        *FRICTION,
        replace(LOSS, only=ELASTIC),
        Parameter(
            name="gear",
            shape="word",
            words=("elastic", "rigid"),
            default="elastic",
            doc="`elastic`: the gear winds up between motor and joint; `rigid`: motor and joint are one inertia",
        ),
        *gear.parameters(ELASTIC),
        *JOINT_FRICTION,
    ),
    outputs=(Memory(name="current_cmd", unit="A", doc="commanded current", limit="i_max"),),
    integrals=(State(name="integral", unit="rad", doc="integral of the motor's rate error"),),
    states=(
        State(name="current", unit="A", doc="current in the armature"),
        State(name="amplifier", unit="V", doc="integral part of the current loop, as a voltage"),
        gear.deflection(ELASTIC),
        replace(compliant_gearbox.MOTOR_RATE, only=ELASTIC),
        BRISTLE,
    ),
    signals=(
        Signal(name="voltage", unit="V", doc="voltage on the armature", limit="v_max"),
        Signal(name="motor_torque", unit="N*m", doc="motor torque, before friction"),
        replace(compliant_gearbox.GEAR_TORQUE, only=ELASTIC),
    ),
    control=control,
    measured=measured,
    drive=drive,
    begin=begin,
    balance=balance,
    fastest=fastest,
    fastest_law=fastest_law,
    swings=swings,
    full=full,
)
