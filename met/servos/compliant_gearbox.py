"""Compliant gearbox servo: motor and joint are two inertias, connected by an elastic gear; the rate loop is as in
`rigid_gearbox`, on the motor's side.

    d = theta/N - q,  d' = w/N - qd                   winding of the gear, at the joint; theta, w: of the motor
    T = k1 d + k3 d^3 + c d', beyond the play         torque of the gear on the joint (met/servos/gear.py)
    tau = T - f_v_joint qd - s f_c_joint              what the joint gets; its dry friction sticks
    J_m w' = tau_m - T/N - friction                   tau_m as in rigid_gearbox, at the motor's own rate w
    friction = F_v w + s (F_c + loss |T|/N)           sticks too; or Stribeck's, or LuGre's (met/servos/friction.py)

The rotor's inertia is not part of the joint's. With the joint held, the motor oscillates at sqrt(k1/(N^2 J_m)), and
against a joint of inertia J at sqrt(k1 (1/(N^2 J_m) + 1/J)). The loop sees the motor's tachometer and encoder, not the
joint. A run begins with an unwound gear and the motor turning with the joint, so an arm under gravity sags at first,
unless the servos begin balanced.

The gear has no variation of its ratio, and not the hysteresis of a harmonic drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter, Signal, State
from met.servos import gear, rate_loop
from met.servos.friction import BRISTLE, LOSS, SHAFT, friction, steady
from met.servos.friction import PARAMETERS as FRICTION
from met.servos.motor import ARMATURE, RATIO, TAU_MAX, damping, torque
from met.servos.servo import Control, Drive, JointMotion, Seen, Servo
from met.trace import Real, maximum, sign, sqrt


def measured(p: Any, q: Real, qd: Real, states: Any) -> tuple[Real, Real]:
    """The motor's angle and rate over the ratio: encoder and tachometer sit on its shaft."""
    return q + states.deflection, states.motor_rate / p.ratio


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The rate loop: the motor's voltage."""
    return rate_loop.rate_loop(p, held.integral, seen.setpoint, q=seen.q, qd=seen.qd)


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """The motor, the gear and their friction, under the voltage."""
    tau_m = torque(p.kt, p.resistance, p.tau_max, held.voltage, states.motor_rate)
    return geared(p, states, joint, tau_m, p.tau_max, {"motor_torque": tau_m})


def geared(
    p: Any, states: Any, joint: JointMotion, tau_m: Real, strongest: Real, own_signals: Mapping[str, Real]
) -> Drive:
    """The drive of a motor behind the gear, with this torque, N m, and at most the strongest; own_signals: its own
    signals."""
    w = states.motor_rate
    rate = w / p.ratio - joint.qd
    T = gear.torque(p, states.deflection, rate)
    at_motor = joint.coupled * T / p.ratio
    drag = friction(p, w, states, at_motor, strongest)
    return Drive(
        torque=T - p.f_v_joint * joint.qd,
        dry=p.f_c_joint,
        slopes={"deflection": rate, "motor_rate": (tau_m - at_motor - drag.torque) / p.j_m, **drag.bending},
        friction={"motor_rate": drag.level / p.j_m},
        rotors={"motor_rate": p.j_m},
        signals={**own_signals, "gear_torque": joint.coupled * T},
        kinetic=0.5 * p.j_m * (w * w),
        potential=gear.energy(p, states.deflection),
        state_out_of_range=drag.state_out_of_range,
    )


def begin(p: Any, q: Real, qd: Real) -> Mapping[str, Real]:
    """Start with an unwound gear, and the motor turning with the joint."""
    starts: dict[str, Real] = {"deflection": 0.0, "motor_rate": p.ratio * qd}
    return starts | ({"bristle": 0.0} if p.friction == "lugre" else {})


def balance(p: Any, torque: Real, seen: Seen) -> Mapping[str, Real]:
    """The gear wound up by the joint's torque, with the motor holding it so."""
    states, tau_m = balanced(p, torque, seen.qd)
    at_motor = seen.q + states["deflection"]  # seen with an unwound gear
    return {**states, **rate_loop.balanced(p, tau_m, seen.setpoint, q=at_motor, qd=seen.qd)}


def balanced(p: Any, torque: Real, qd: Real) -> tuple[dict[str, Real], Real]:
    """States behind a gear that drives the joint with this torque at this constant rate, and the motor's torque."""
    through = torque + p.f_v_joint * qd + sign(qd) * p.f_c_joint
    drag, bent = steady(p, p.ratio * qd, through / p.ratio)
    return {"deflection": gear.wound(p, through), "motor_rate": p.ratio * qd, **bent}, through / p.ratio + drag


def fastest_law(p: Any) -> Real:
    """The larger of `fastest` and the rate loop's rate constant on the motor alone, 1/s."""
    return maximum(fastest(p), rate_loop.fastest(p))


def fastest(p: Any) -> Real:
    """The rate constant of the motor with the joint held, 1/s: its damping, or the gear's frequency. Against a light
    joint it is faster."""
    inertia = p.ratio * p.ratio * p.j_m
    return maximum(damping(p.kt, p.resistance, p.f_v) / p.j_m + p.damping / inertia, sqrt(p.stiffness / inertia))


def swings(p: Any, kind: str) -> Mapping[str, tuple[Real, Real]]:
    """Oscillations of the motor on its gear, damped by back-EMF and by the loop's gain; a torque command takes both
    away."""
    by_law = 0.0 if kind == "torque" else p.kt * p.kt / p.resistance + p.kt * p.kp / p.resistance
    return {"gear": swing(p, by_law)}


def swing(p: Any, by_law: Real) -> tuple[Real, Real]:
    """The a and b of a motor on its gear. by_law: damping of the shaft by the law, N m s/rad."""
    inertia = p.ratio * p.ratio * p.j_m
    return p.stiffness / inertia, (by_law + p.f_v) / p.j_m + p.damping / inertia


JOINT_FRICTION = (
    Parameter(name="f_c_joint", unit="effort", default=0.0, at_least=0.0, doc="Coulomb friction at the joint"),
    Parameter(
        name="f_v_joint",
        unit="effort*s/joint",
        default=0.0,
        at_least=0.0,
        doc="viscous friction at the joint: torque per joint rate",
    ),
)
MOTOR_RATE = State(name="motor_rate", unit="rad/s", doc="rate of the motor's shaft")
GEAR_TORQUE = Signal(name="gear_torque", unit="effort", doc="torque of the gear on the joint")

SERVO = Servo(
    name="compliant_gearbox",
    doc=__doc__,
    commands=rate_loop.COMMANDS,
    parameters=(
        RATIO,
        *rate_loop.PARAMETERS,
        *ARMATURE,
        TAU_MAX,
        *SHAFT,
        *FRICTION,
        LOSS,
        *gear.parameters(),
        *JOINT_FRICTION,
    ),
    outputs=rate_loop.OUTPUTS,
    integrals=rate_loop.INTEGRALS,
    states=(gear.deflection(), MOTOR_RATE, BRISTLE),
    signals=(
        Signal(name="motor_torque", unit="N*m", doc="motor torque, before friction", limit="tau_max"),
        GEAR_TORQUE,
    ),
    control=control,
    measured=measured,
    drive=drive,
    begin=begin,
    balance=balance,
    fastest=fastest,
    fastest_law=fastest_law,
    swings=swings,
    full=rate_loop.full,
)
