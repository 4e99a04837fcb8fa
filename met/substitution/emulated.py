"""The emulated bed: two motors on a shaft, a tachometer with a filter, converters, and the faults of each.

    J w' = tau_m(V, w) + Kt_load i - F_v w - s F_c + unevenness,   s as friction sticks

The drive motor is fed by a voltage amplifier, the load motor by a current amplifier; the rest is common to all emulated
beds. The faults are a ripple of the load torque (`unevenness` of it, `lobes` periods per turn), misaligned motors
(`once` and `twice` per turn), noise of the tachometer (`tachometer`, rms, a new value at each tick), and the resolution
of the converters (0: none).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from met.parameter import Memory, Parameter
from met.sensors.sensor import converted
from met.servos.motor import TABLE_1, damping, torque
from met.substitution import butterworth, shaft
from met.substitution.bed import BedModel, Draw, Wire
from met.trace import Real, Truth, absolute, clip, sin

SUBSTEP = 250e-6
"""Longest substep, s. Against one of 50 us a run moves by 0.005 % of its rate, all faults on."""

# where misalignment is worst, rad: arbitrary angles
_ONCE_AT, _TWICE_AT = 0.3, 1.1


def begin(p: Any, w: Real) -> Mapping[str, Real]:
    return {"shaft_rate": w, "shaft_angle": 0.0, "filtered": w, "filtered_slope": 0.0}


def substep(time: float) -> float:
    """Length of the substeps of a time, s."""
    return time / math.ceil(time / SUBSTEP - 1e-9)


def turned(
    p: Any, held: Any, current: Real, time: float, draw: Draw, driving: Callable[[Real], Real], decay: Real
) -> Mapping[str, Real]:
    """The memory after `time` s, by name.

    Between its substeps the bed is exact while the shaft slides on and no limit is reached; a shaft that turns back
    stops first, within a substep. The tachometer's signal goes through a Butterworth filter of order 2 and a converter.

    current  of the load motor, A
    driving  rate of the shaft as a substep begins, rad/s -> torque of the drive motor, N m; called once in each
    decay    rate at which smooth torque falls as the shaft gains speed, above 0, 1/s
    """
    count = math.ceil(time / SUBSTEP - 1e-9)
    h = time / count
    lowpass = butterworth.over(p.f_cut, h)
    load = p.kt_load * current
    noise = p.tachometer * draw("tachometer")
    w, angle, x = held.shaft_rate, held.shaft_angle, (held.filtered, held.filtered_slope)
    for _ in range(count):
        uneven = (
            p.unevenness * absolute(load) * sin(p.lobes * angle)
            + p.once * sin(angle + _ONCE_AT)
            + p.twice * sin(2.0 * angle + _TWICE_AT)
        )
        smooth = driving(w) + load - p.f_v * w + uneven
        after = shaft.slid(w, smooth, p.f_c, inertia=p.inertia, decay=decay, time=h)
        x = butterworth.along_line(lowpass, x, w + noise, after + noise)
        angle = angle + 0.5 * h * (w + after)
        w = after
    return {"shaft_rate": w, "shaft_angle": angle, "filtered": x[0], "filtered_slope": x[1]}


def read(p: Any, held: Any) -> Real:
    return converted(held.filtered, p.converter_in)


ASSUMED = "assumption, of the size that such motors have"

ARMATURE = (
    Parameter(
        name="kt", unit="N*m/A", above=0.0, of_servo="kt", doc="torque constant of the drive motor that is on the bed"
    ),
    Parameter(
        name="resistance", unit="ohm", above=0.0, of_servo="resistance", doc="armature resistance of the drive motor"
    ),
)

TAU_MAX = Parameter(name="tau_max", unit="N*m", above=0.0, of_servo="tau_max", doc="largest torque of the drive motor")

SHAFT = (
    Parameter(name="f_c", unit="N*m", at_least=0.0, of_servo="f_c", doc="Coulomb friction of the shaft"),
    Parameter(name="f_v", unit="N*m*s/rad", at_least=0.0, of_servo="f_v", doc="viscous friction of the shaft"),
    Parameter(name="inertia", unit="kg*m^2", above=0.0, of_servo="j_m", doc="inertia of the shaft with both rotors"),
)

REST = (
    Parameter(
        name="kt_load",
        unit="N*m/A",
        default=0.072,
        above=0.0,
        source=TABLE_1,
        doc="torque constant of the load motor",
    ),
    Parameter(
        name="i_max",
        unit="A",
        default=3.0,
        above=0.0,
        source=ASSUMED,
        doc="largest current of the load motor's amplifier",
    ),
    Parameter(
        name="f_cut",
        unit="Hz",
        default=50.0,
        above=0.0,
        source=TABLE_1,
        doc="cut-off frequency of the tachometer's filter",
    ),
    Parameter(
        name="delay",
        default=0.0,
        at_least=0.0,
        at_most=3.0,
        whole=True,
        doc="whole ticks from the reading of the rate to the response to it; 1 for most hardware",
    ),
    Parameter(
        name="faults",
        shape="text",
        default="none",
        doc="size of all faults that are not written one by one: `none` or `typical`",
    ),
    Parameter(
        name="unevenness",
        at_least=0.0,
        default=0.0,
        doc="amplitude of the torque ripple, as a share of the load torque",
    ),
    Parameter(
        name="lobes", above=0.0, default=7.0, source=ASSUMED, doc="periods of the torque ripple per turn of the shaft"
    ),
    Parameter(
        name="once",
        unit="N*m",
        at_least=0.0,
        default=0.0,
        doc="amplitude of the misalignment torque with one period per turn",
    ),
    Parameter(
        name="twice",
        unit="N*m",
        at_least=0.0,
        default=0.0,
        doc="amplitude of the misalignment torque with two periods per turn",
    ),
    Parameter(name="tachometer", unit="rad/s", at_least=0.0, default=0.0, doc="noise of the tachometer, rms"),
    Parameter(
        name="converter_in",
        unit="rad/s",
        at_least=0.0,
        default=0.0,
        doc="resolution of the converter that reads the rate",
    ),
)
"""Parameters of load motor, tachometer, delay and faults."""

CURRENT = Parameter(
    name="converter_current", unit="A", at_least=0.0, default=0.0, doc="resolution of the converter for the current"
)

MEMORY = (
    Memory(name="shaft_rate", unit="rad/s", doc="rate of the shaft"),
    Memory(name="shaft_angle", unit="rad", doc="angle of the shaft"),
    Memory(name="filtered", unit="rad/s", doc="output of the tachometer's filter"),
    Memory(name="filtered_slope", unit="rad/s^2", doc="rate of change of the filter's output"),
)

# 12-bit converters over +-400 rad/s and +-3 A
TYPICAL = {
    "unevenness": 0.02,
    "once": 0.002,
    "twice": 0.001,
    "tachometer": 0.1,
    "converter_in": 800.0 / 4096.0,
    "converter_current": 6.0 / 4096.0,
}


def advance(p: Any, held: Any, wire: Wire, time: float, draw: Draw) -> Mapping[str, Real]:
    """The memory of the bed after `time` s, by name, with the motor's torque at the held voltage as driving torque."""

    def driving(w: Real) -> Real:
        return torque(p.kt, p.resistance, p.tau_max, wire.voltage, w)

    decay = damping(p.kt, p.resistance, p.f_v) / p.inertia
    return turned(p, held, wire.current, time, draw, driving, decay)


def taken(p: Any, wire: Wire) -> tuple[Wire, Truth]:
    current = converted(wire.current, p.converter_current)
    held = Wire(converted(wire.voltage, p.converter_voltage), clip(current, -p.i_max, p.i_max))
    return held, absolute(current) > p.i_max


BED = BedModel(
    name="emulated",
    doc=__doc__,
    parameters=(
        *ARMATURE,
        TAU_MAX,
        *SHAFT,
        *REST,
        Parameter(
            name="converter_voltage",
            unit="V",
            at_least=0.0,
            default=0.0,
            doc="resolution of the converter for the voltage",
        ),
        CURRENT,
    ),
    memory=MEMORY,
    begin=begin,
    advance=advance,
    read=read,
    taken=taken,
    # a 12-bit converter over +-20 V
    presets={"none": {}, "typical": {**TYPICAL, "converter_voltage": 40.0 / 4096.0}},
)
