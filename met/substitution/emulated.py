"""The emulated bed: two motors on a shaft, a tachometer with a filter, converters, and the faults of each.

    J w' = tau_m(V, w) + Kt_load i - F_v w - s F_c + unevenness,   s as friction sticks

The drive motor is fed by a voltage amplifier, the load motor by a current amplifier; the rest is in emulated_shaft.py.
The faults are a ripple of the load torque (`unevenness` of it, `lobes` periods per turn), misaligned motors (`once` and
`twice` per turn), noise of the tachometer (`tachometer`, rms, a new value at each tick), and the resolution of the
converters (0: none).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter
from met.sensors.sensor import converted
from met.servos.motor import damping, torque
from met.substitution import emulated_shaft
from met.substitution.bed import BedModel, Draw, Wire
from met.trace import Real, Truth, absolute, clip


def advance(p: Any, held: Any, wire: Wire, time: float, draw: Draw) -> Mapping[str, Real]:
    def driving(w: Real) -> Real:
        return torque(p.kt, p.resistance, p.tau_max, wire.voltage, w)

    decay = damping(p.kt, p.resistance, p.f_v) / p.inertia
    return emulated_shaft.turned(p, held, wire.current, time, draw, driving, decay)


def taken(p: Any, wire: Wire) -> tuple[Wire, Truth]:
    current = converted(wire.current, p.converter_current)
    held = Wire(converted(wire.voltage, p.converter_voltage), clip(current, -p.i_max, p.i_max))
    return held, absolute(current) > p.i_max


BED = BedModel(
    name="emulated",
    doc=__doc__,
    parameters=(
        *emulated_shaft.ARMATURE,
        emulated_shaft.TAU_MAX,
        *emulated_shaft.SHAFT,
        *emulated_shaft.REST,
        Parameter(
            name="converter_voltage",
            unit="V",
            at_least=0.0,
            default=0.0,
            doc="resolution of the converter for the voltage",
        ),
        emulated_shaft.CURRENT,
    ),
    memory=emulated_shaft.MEMORY,
    begin=emulated_shaft.begin,
    advance=advance,
    read=emulated_shaft.read,
    taken=taken,
    # a 12-bit converter over +-20 V
    presets={"none": {}, "typical": {**emulated_shaft.TYPICAL, "converter_voltage": 40.0 / 4096.0}},
)
