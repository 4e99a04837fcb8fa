"""Compliant gearbox servo: motor and joint are two inertias, joined by a gear that winds up; the rate loop is as in
`rigid_gearbox`, on the motor's side.

    d = theta/N - q,  d' = w/N - qd                   winding of the gear, at the joint; theta, w: of the motor
    T = k1 d + k3 d^3 + c d', beyond the play         torque of the gear on the joint (met/servos/gear.py)
    tau = T - f_v_joint qd - s f_c_joint              what the joint gets; its dry friction sticks
    J_m w' = tau_m - T/N - friction                   tau_m as in rigid_gearbox, at the motor's own rate w
    friction = F_v w + s (F_c + loss |T|/N)           sticks too; or Stribeck's, or LuGre's (met/servos/friction.py)

The rotor's inertia is not the joint's: with the joint held the motor swings at sqrt(k1/(N^2 J_m)), and against a joint
of inertia J at sqrt(k1 (1/(N^2 J_m) + 1/J)). The loop sees the motor's tachometer and encoder, not the joint. A run
begins with the gear not wound up, the motor turning with the joint: what gravity pulls at sinks in.

Not a gear whose ratio wavers, and not a harmonic drive's hysteresis.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter, Signal, State
from met.servos import gear, rate_loop
from met.servos.friction import BRISTLE, LOSS, friction
from met.servos.friction import PARAMETERS as FRICTION
from met.servos.motor import ARMATURE, RATIO, SHAFT, TAU_MAX, damping, torque
from met.servos.servo import Control, Drive, JointMotion, Seen, Servo
from met.trace import Real, maximum, sqrt


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The rate loop on the motor's tachometer and encoder: the motor's voltage."""
    at_motor = seen.q + seen.states.deflection
    return rate_loop.rate_loop(p, held.integral, seen.asked, q=at_motor, qd=seen.states.motor_rate / p.ratio)


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """The motor, the gear and their friction, under the voltage."""
    tau_m = torque(p.kt, p.resistance, p.tau_max, held.voltage, states.motor_rate)
    return geared(p, states, joint, tau_m, {"motor_torque": tau_m})


def geared(p: Any, states: Any, joint: JointMotion, tau_m: Real, shown: Mapping[str, Real]) -> Drive:
    """A motor that gives this torque (N m), behind the gear; shown: signals besides the gear's."""
    w = states.motor_rate
    rate = w / p.ratio - joint.qd
    T = gear.torque(p, states.deflection, rate)
    at_motor = T / p.ratio
    rubs = friction(p, w, states, at_motor)
    return Drive(
        torque=T - p.f_v_joint * joint.qd,
        dry=p.f_c_joint,
        slopes={"deflection": rate, "motor_rate": (tau_m - at_motor - rubs.torque) / p.j_m, **rubs.bending},
        friction={"motor_rate": rubs.level / p.j_m},
        signals={**shown, "gear_torque": T},
    )


def begin(p: Any, q: Real, qd: Real) -> Mapping[str, Real]:
    """Nothing is wound up, and the motor turns with the joint."""
    starts: dict[str, Real] = {"deflection": 0.0, "motor_rate": p.ratio * qd}
    return starts | ({"bristle": 0.0} if p.friction == "lugre" else {})


def fastest(p: Any) -> Real:
    """The motor with the joint held, 1/s: its damping, or the gear's frequency. Against a light joint it is faster."""
    inertia = p.ratio * p.ratio * p.j_m
    return maximum(damping(p.kt, p.resistance, p.f_v) / p.j_m + p.damping / inertia, sqrt(p.stiffness / inertia))


JOINT_FRICTION = (
    Parameter(name="f_c_joint", unit="effort", default=0.0, at_least=0.0, doc="Coulomb friction at the joint"),
    Parameter(name="f_v_joint", unit="effort*s/joint", default=0.0, at_least=0.0, doc="viscous friction at the joint"),
)
MOTOR_RATE = State(name="motor_rate", unit="rad/s", doc="rate of the motor's shaft")
GEAR_TORQUE = Signal(name="gear_torque", unit="effort", doc="torque of the gear on the joint")

SERVO = Servo(
    name="compliant_gearbox",
    doc=__doc__,
    commands=rate_loop.COMMANDS,
    parameters=(
        RATIO, *rate_loop.PARAMETERS, *ARMATURE, TAU_MAX, *SHAFT, *FRICTION, LOSS, *gear.parameters(), *JOINT_FRICTION
    ),
    outputs=rate_loop.OUTPUTS,
    integrals=rate_loop.INTEGRALS,
    states=(gear.deflection(), MOTOR_RATE, BRISTLE),
    signals=(Signal(name="motor_torque", unit="N*m", doc="motor torque, before friction"), GEAR_TORQUE),
    control=control,
    drive=drive,
    begin=begin,
    fastest=fastest,
)  # fmt: skip
