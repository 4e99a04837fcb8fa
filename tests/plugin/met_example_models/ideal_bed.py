"""Ideal bed: two motors on a shaft without friction, noise or converters; a tachometer behind the usual filter.

    J w' = kt/R (V - kt w) + kt_load i       exact while V and i are held

Not for `--port firmware`: its guard would want the largest torque and the friction, which this bed has not.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Memory, Parameter
from met.substitution import BedModel, butterworth
from met.substitution.bed import Draw, Wire
from met.trace import Real, Truth, absolute, clip, exp


def begin(p: Any, w: Real) -> Mapping[str, Real]:
    """A shaft that has turned at w for long: the filter has settled."""
    return {"shaft_rate": w, "filtered": w, "filtered_slope": 0.0}


def advance(p: Any, held: Any, wire: Wire, time: float, draw: Draw) -> Mapping[str, Real]:
    """Shaft and filter after `time` s under what the amplifiers hold. `draw` is for noise: there is none."""
    decay = p.kt * p.kt / p.resistance / p.inertia
    final = (p.kt / p.resistance * wire.voltage + p.kt_load * wire.current) / (decay * p.inertia)
    w = final + (held.shaft_rate - final) * exp(-decay * time)
    filter = butterworth.over(p.f_cut, time)
    y, slope = butterworth.along_line(filter, (held.filtered, held.filtered_slope), held.shaft_rate, w)
    return {"shaft_rate": w, "filtered": y, "filtered_slope": slope}


def read(p: Any, held: Any) -> Real:
    """The filtered rate, as the computer reads it."""
    return held.filtered


def taken(p: Any, wire: Wire) -> tuple[Wire, Truth]:
    """The amplifiers limit the load motor's current, and say whether they did."""
    return Wire(wire.voltage, clip(wire.current, -p.i_max, p.i_max)), absolute(wire.current) > p.i_max


BED = BedModel(
    name="ideal_bed",
    doc=__doc__,
    parameters=(
        Parameter(
            name="inertia", unit="kg*m^2", above=0.0, of_servo="j_m", doc="inertia of the shaft with both rotors"
        ),
        Parameter(name="kt_load", unit="N*m/A", above=0.0, default=0.072, doc="torque constant of the load motor"),
        Parameter(name="f_cut", unit="Hz", above=0.0, default=50.0, doc="cut-off frequency of the tachometer's filter"),
        Parameter(name="delay", at_least=0.0, at_most=3.0, whole=True, default=0.0, doc="ticks from reading to acting"),
        Parameter(name="kt", unit="N*m/A", above=0.0, of_servo="kt", doc="torque constant of the drive motor"),
        Parameter(
            name="resistance",
            unit="ohm",
            above=0.0,
            of_servo="resistance",
            doc="armature resistance of the drive motor",
        ),
        Parameter(name="i_max", unit="A", above=0.0, default=3.0, doc="largest current of the load motor's amplifier"),
    ),
    memory=(
        Memory(name="shaft_rate", unit="rad/s", doc="rate of the shaft"),
        Memory(name="filtered", unit="rad/s", doc="output of the tachometer's filter"),
        Memory(name="filtered_slope", unit="rad/s^2", doc="rate of change of the filter's output"),
    ),
    begin=begin,
    advance=advance,
    read=read,
    taken=taken,
)
