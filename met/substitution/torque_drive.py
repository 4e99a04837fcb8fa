"""A drive with a current loop of its own, emulated: its command is the torque of the motor, as for most drives on a CAN
bus.

    J w' = tau_m + Kt_load i - F_v w - s F_c + unevenness,   tau_m' = 2 pi bandwidth (gain tau_told - tau_m)

The servo's law down to the motor's torque is computed by MET, with its voltage and the motor's resistance and back-EMF,
and the drive is commanded the mean torque of the coming tick. What is tried is the drive's torque: how fast it follows
(`bandwidth`), how true it is (`gain`), where it ends (`tau_max`), besides the shaft, its friction and faults, which are
those of `emulated`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter
from met.sensors.sensor import converted
from met.substitution import emulated
from met.substitution.bed import TORQUE, BedModel, Draw, Wire
from met.substitution.drive import LEAST, at_least
from met.trace import Real, Truth, absolute, clip, exp


def begin(p: Any, w: Real) -> Mapping[str, Real]:
    return {**emulated.begin(p, w), "motor_torque": 0.0}


def advance(p: Any, held: Any, wire: Wire, time: float, draw: Draw) -> Mapping[str, Real]:
    """The memory of the bed after `time` s, by name, with the drive's current loop, a low-pass, as driving torque."""
    h = emulated.substep(time)
    times = 2.0 * math.pi * p.bandwidth * h
    left = exp(-times)
    goal, tau = p.gain * wire.drive, held.motor_torque

    def driving(w: Real) -> Real:
        nonlocal tau
        away, tau = tau - goal, goal + (tau - goal) * left
        return goal + away * ((1.0 - left) / times)  # the mean of the substep

    decay = at_least(p.f_v / p.inertia, LEAST / h)
    memory = emulated.turned(p, held, wire.current, time, draw, driving, decay)
    return {**memory, "motor_torque": tau}


def taken(p: Any, wire: Wire) -> tuple[Wire, Truth]:
    tau, current = converted(wire.drive, p.converter_torque), converted(wire.current, p.converter_current)
    held = Wire(clip(tau, -p.tau_max, p.tau_max), clip(current, -p.i_max, p.i_max))
    return held, absolute(current) > p.i_max


BED = BedModel(
    name="torque_drive",
    doc=__doc__,
    drive="torque",
    parameters=(
        emulated.TAU_MAX,
        Parameter(
            name="gain", above=0.0, default=1.0, doc="torque of the drive divided by the torque that it is commanded"
        ),
        Parameter(
            name="bandwidth",
            unit="Hz",
            above=0.0,
            default=math.inf,
            doc="bandwidth of the drive's current loop; inf: the torque follows at once",
        ),
        *emulated.SHAFT,
        *emulated.REST,
        Parameter(
            name="converter_torque", unit="N*m", at_least=0.0, default=0.0, doc="resolution of the commanded torque"
        ),
        emulated.CURRENT,
    ),
    memory=(*emulated.MEMORY, TORQUE),
    begin=begin,
    advance=advance,
    read=emulated.read,
    taken=taken,
    # 12 bits over +-0.15 N m, the torque of such a motor
    presets={"none": {}, "typical": {**emulated.TYPICAL, "converter_torque": 0.3 / 4096.0}},
)
