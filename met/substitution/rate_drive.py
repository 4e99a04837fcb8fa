"""A drive with a rate loop of its own, emulated: its command is the rate of the shaft, as for drives in velocity mode.

    J w' = tau_m(V, w) + Kt_load i - F_v w - s F_c + unevenness
    e = w_told - w,  V = clip(Kp e + Ki I, +-V_max),  dI/dt = e, held while V is limited and e would push it further

The servo's law above its rate loop is computed by MET: its command, and its position loop. What is tried is all below,
the drive's loop and its motor. The loop is that of the servo, with gains of its own if they are written. It acts on the
rate of the shaft itself, and runs once in each substep, at 4 kHz or more; shaft, friction and faults are those of
`emulated`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Memory, Parameter
from met.sensors.sensor import converted
from met.servos.motor import RateLoop, damping, torque
from met.substitution import emulated
from met.substitution.bed import TORQUE, BedModel, Draw, Wire
from met.substitution.drive import wound
from met.trace import Real, Truth, absolute, clip


def begin(p: Any, w: Real) -> Mapping[str, Real]:
    return {**emulated.begin(p, w), "integral": 0.0, "motor_torque": 0.0}


def advance(p: Any, held: Any, wire: Wire, time: float, draw: Draw) -> Mapping[str, Real]:
    """The memory of the bed after `time` s, by name, with the drive's rate loop as driving torque."""
    h = emulated.substep(time)
    loop = RateLoop(p.kp, p.ki, p.v_max)
    integral, tau = held.integral, held.motor_torque

    def driving(w: Real) -> Real:
        """The torque of the drive motor in the next substep, N m, by the drive's rate loop at the shaft's rate w,
        rad/s."""
        nonlocal integral, tau
        error = wire.drive - w
        voltage = clip(p.kp * error + p.ki * integral, -p.v_max, p.v_max)
        integral = wound(loop, integral, error, h)
        tau = torque(p.kt, p.resistance, p.tau_max, voltage, w)
        return tau

    decay = damping(p.kt, p.resistance, p.f_v) / p.inertia
    memory = emulated.turned(p, held, wire.current, time, draw, driving, decay)
    return {**memory, "integral": integral, "motor_torque": tau}


def taken(p: Any, wire: Wire) -> tuple[Wire, Truth]:
    rate, current = converted(wire.drive, p.converter_rate), converted(wire.current, p.converter_current)
    return Wire(rate, clip(current, -p.i_max, p.i_max)), absolute(current) > p.i_max


BED = BedModel(
    name="rate_drive",
    doc=__doc__,
    drive="rate",
    parameters=(
        Parameter(
            name="kp", unit="V*s/rad", at_least=0.0, of_servo="kp", doc="proportional gain of the drive's rate loop"
        ),
        Parameter(name="ki", unit="V/rad", at_least=0.0, of_servo="ki", doc="integral gain of the drive's rate loop"),
        Parameter(name="v_max", unit="V", above=0.0, of_servo="v_max", doc="largest voltage of the drive's amplifier"),
        *emulated.ARMATURE,
        emulated.TAU_MAX,
        *emulated.SHAFT,
        *emulated.REST,
        Parameter(
            name="converter_rate", unit="rad/s", at_least=0.0, default=0.0, doc="resolution of the commanded rate"
        ),
        emulated.CURRENT,
    ),
    memory=(
        *emulated.MEMORY,
        Memory(name="integral", unit="rad", doc="integral of the rate error in the drive's own loop"),
        TORQUE,
    ),
    begin=begin,
    advance=advance,
    read=emulated.read,
    taken=taken,
    # 16 bits over +-400 rad/s
    presets={"none": {}, "typical": {**emulated.TYPICAL, "converter_rate": 800.0 / 65536.0}},
)
