"""Rigid gearbox servo: a PI rate loop drives a DC motor through a rigid gearbox with friction.

    w = N qd                                          motor rate; everything here is on the motor's side
    e = N qd_cmd - w                                  rate error
    V* = Kp e + Ki I,  V = clip(V*, +-V_max)          at a tick, held to the next; or continuous
    dI/dt = e, 0 where V* is beyond the limit and e would push it further; I+ = I + T dI/dt at a tick
    tau_m = clip(Kt (V - Kt w)/R, +-tau_max)          at every stage; tau_max does not stop the integral
    tau = N (tau_m - friction),  friction = s F_c + F_v w,  s in {0, +1, -1} (stuck, forward, backward)

Friction may also follow the law of Stribeck or that of LuGre (met/servos/friction.py).

The rotor's inertia N^2 J_m moves with the joint. The model is that of figure 3 and table 1 of Hill, Hopping and Price
(1989). Its gearbox has no compliance. The reaction of the turning rotor on the link that carries it is computed on a
free base only.

Under a position command, the rate loop gets qd_cmd = d(q_cmd)/dt + k_position (q_cmd - q). Under a torque command, the
voltage is the one that gives this torque at the rate that the law sees, without the share of friction; this is open
loop.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Signal
from met.servos import rate_loop
from met.servos.friction import BRISTLE, SHAFT, friction, steady
from met.servos.friction import PARAMETERS as FRICTION
from met.servos.motor import ARMATURE, RATIO, TAU_MAX, Motor, torque
from met.servos.servo import Control, Drive, JointMotion, Seen, Servo
from met.trace import Real


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The rate loop: the motor's voltage."""
    return rate_loop.rate_loop(p, held.integral, seen.setpoint, q=seen.q, qd=seen.qd)


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """The motor, the gearbox and their friction, under the voltage."""
    w_m = p.ratio * joint.qd
    tau_m = torque(p.kt, p.resistance, p.tau_max, held.voltage, w_m)
    drag = friction(p, w_m, states)
    return Drive(
        torque=p.ratio * (tau_m - drag.torque),
        dry=p.ratio * drag.level,
        rotor=p.ratio * p.ratio * p.j_m,
        spin=p.ratio * p.j_m,
        slopes=drag.bending,
        signals={"motor_rate": w_m, "motor_torque": tau_m},
        state_out_of_range=drag.state_out_of_range,
    )


def balance(p: Any, torque: Real, seen: Seen) -> Mapping[str, Real]:
    """The motor's torque for joint and friction, and the loop's integral that commands it."""
    drag, bent = steady(p, p.ratio * seen.qd)
    return {**bent, **rate_loop.balanced(p, torque / p.ratio + drag, seen.setpoint, q=seen.q, qd=seen.qd)}


def fastest(p: Any) -> Real:
    """Upper bound of the braking of the rotor by back-EMF and viscous friction: (Kt^2/R + F_v)/J_m, 1/s."""
    return motor(p).damping / p.j_m


def motor(p: Any) -> Motor:
    """The motor's parameters, in the form that a motor bed needs in its place."""
    return Motor(
        ratio=p.ratio, kt=p.kt, resistance=p.resistance, tau_max=p.tau_max, inertia=p.j_m, f_c=p.f_c, f_v=p.f_v
    )


SERVO = Servo(
    name="rigid_gearbox",
    doc=__doc__,
    commands=rate_loop.COMMANDS,
    parameters=(RATIO, *rate_loop.PARAMETERS, *ARMATURE, TAU_MAX, *SHAFT, *FRICTION),
    outputs=rate_loop.OUTPUTS,
    integrals=rate_loop.INTEGRALS,
    states=(BRISTLE,),
    signals=(
        Signal(name="motor_rate", unit="rad/s", doc="rate of the motor's shaft"),
        Signal(name="motor_torque", unit="N*m", doc="motor torque, before friction", limit="tau_max"),
    ),
    control=control,
    drive=drive,
    balance=balance,
    fastest=fastest,
    fastest_law=rate_loop.fastest,
    full=rate_loop.full,
    motor=motor,
    rate_loop=rate_loop.settings,
    rate_wanted=rate_loop.rate_wanted,
    motor_only=("friction", ("coulomb",)),
)
