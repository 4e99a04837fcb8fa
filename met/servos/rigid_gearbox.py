"""Rigid gearbox servo: a PI rate loop drives a DC motor through a rigid gearbox with sticking friction.

    w = N qd                                          motor rate; everything here is on the motor's side
    e = N qd_cmd - w                                  rate error
    V* = Kp e + Ki I,  V = clip(V*, +-V_max)          at a tick, held to the next; or continuous
    dI/dt = e, 0 where V* is beyond the limit and e would push it further; I+ = I + T dI/dt at a tick
    tau_m = clip(Kt (V - Kt w)/R, +-tau_max)          at every stage; tau_max does not stop the integral
    tau = N (tau_m - friction),  friction = s F_c + F_v w,  s in {0, +1, -1} (stuck, forward, backward)

The rotor's inertia N^2 J_m moves with the joint. Figure 3 and table 1 of Hill, Hopping and Price (1989).
Not a gearbox with compliance, and neither the rotor's gyroscopic torque nor its coupling to the parent's rotation.

A position command is followed by asking the rate loop for qd_cmd = d(q_cmd)/dt + k_position (q_cmd - q). A torque
command sets the voltage that gives this torque at the rate seen, without friction's share; it is open loop.
"""

from __future__ import annotations

from typing import Any

from met.parameter import Memory, Parameter, Signal, State
from met.servos.motor import Motor, torque
from met.servos.servo import Asked, Control, Drive, JointMotion, Seen, Servo
from met.trace import Real, both, clip, either, where


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The rate loop: the motor's voltage."""
    if seen.asked.kind == "torque":
        torque_m = seen.asked.value / p.ratio
        voltage = p.resistance * torque_m / p.kt + p.kt * p.ratio * seen.qd
        return Control({"voltage": clip(voltage, -p.v_max, p.v_max)}, {"integral": 0.0})

    error = p.ratio * (_rate_asked(p, seen.q, seen.asked) - seen.qd)
    wanted = p.kp * error + p.ki * held.integral
    winding_up = either(both(wanted > p.v_max, error > 0.0), both(wanted < -p.v_max, error < 0.0))
    return Control({"voltage": clip(wanted, -p.v_max, p.v_max)}, {"integral": where(winding_up, 0.0, error)})


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """The motor, the gearbox and their friction, under the voltage held."""
    w_m = p.ratio * joint.qd
    tau_m = torque(p.kt, p.resistance, p.tau_max, held.voltage, w_m)
    return Drive(
        torque=p.ratio * (tau_m - p.f_v * w_m),
        dry=p.ratio * p.f_c,
        rotor=p.ratio * p.ratio * p.j_m,
        signals={"motor_rate": w_m, "motor_torque": tau_m},
    )


def fastest(p: Any) -> Real:
    """Back-EMF and viscous friction brake the rotor at most this fast: (Kt^2/R + F_v)/J_m, 1/s."""
    return motor(p).damping / p.j_m


def motor(p: Any) -> Motor:
    """The motor, which a bed may take the place of."""
    return Motor(
        ratio=p.ratio, kt=p.kt, resistance=p.resistance, tau_max=p.tau_max, inertia=p.j_m, f_c=p.f_c, f_v=p.f_v
    )


def _rate_asked(p: Any, q: Real, asked: Asked) -> Real:
    if asked.kind == "position":
        return asked.slope + p.k_position * (asked.value - q)
    return asked.value


TABLE_1 = "Hill, Hopping, Price 1989, table 1"

SERVO = Servo(
    name="rigid_gearbox",
    doc=__doc__,
    commands=("rate", "position", "torque"),
    parameters=(
        Parameter(
            name="ratio", unit="rad/joint", above=0.0, source=TABLE_1,
            doc="gear ratio N: motor turns per joint turn",
        ),
        Parameter(name="kp", unit="V*s/rad", at_least=0.0, source=TABLE_1, doc="gain on the motor's rate error"),
        Parameter(name="ki", unit="V/rad", at_least=0.0, source=TABLE_1, doc="gain on the rate error's integral"),
        Parameter(name="v_max", unit="V", above=0.0, source=TABLE_1, doc="largest voltage of the drive's amplifier"),
        Parameter(name="resistance", unit="ohm", above=0.0, source=TABLE_1, doc="armature resistance R"),
        Parameter(
            name="kt", unit="N*m/A", above=0.0, source=TABLE_1,
            doc="torque constant, and back-EMF constant in V s/rad",
        ),
        Parameter(name="tau_max", unit="N*m", above=0.0, source=TABLE_1, doc="largest motor torque, before friction"),
        Parameter(name="j_m", unit="kg*m^2", above=0.0, source=TABLE_1, doc="inertia of the motor's shaft J_m"),
        Parameter(
            name="f_c", unit="N*m", default=0.0, at_least=0.0, source=TABLE_1,
            doc="Coulomb friction at the motor",
        ),
        Parameter(
            name="f_v", unit="N*m*s/rad", default=0.0, at_least=0.0, source=TABLE_1,
            doc="viscous friction at the motor",
        ),
        Parameter(
            name="k_position", unit="1/s", default=0.0, at_least=0.0, needed_for=("position",),
            doc="gain from position error to rate asked, used under a position command alone",
        ),
    ),
    outputs=(Memory(name="voltage", unit="V", doc="voltage on the drive motor"),),
    integrals=(State(name="integral", unit="rad", doc="integral of the motor's rate error"),),
    signals=(
        Signal(name="motor_rate", unit="rad/s", doc="rate of the motor's shaft"),
        Signal(name="motor_torque", unit="N*m", doc="motor torque, before friction"),
    ),
    control=control,
    drive=drive,
    fastest=fastest,
    motor=motor,
)
