"""Tachometer, or any analog sensor: a filter, then noise, a converter and a delay.

    filter = none          y = x
    filter = butterworth   y'' = w^2 (x - y) - sqrt(2) w y',  w = 2 pi cutoff       of order 2, integrated with the arm
    reading                y + noise n_k, to the nearest step of the converter, `delay` ticks late

x is the quantity that it is of, a rate or any other. The noise is white from tick to tick, so its share below some
frequency depends on the servo's rate. A run begins with the filter settled. Not a resolver: it has no ripple.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter, State
from met.sensors.digital import DELAY, NOISE, PAST, RESOLUTION, converted, delayed, filled, noisy
from met.sensors.sensor import Reading, Sensed, Sensor
from met.trace import Real

FILTERED = ("filter", ("butterworth",))


def follow(p: Any, states: Any, value: Real) -> Mapping[str, Real]:
    if p.filter == "none":
        return {}
    w = 2.0 * math.pi * p.cutoff
    bend = w * w * (value - states.filtered) - math.sqrt(2.0) * w * states.filtered_slope
    return {"filtered": states.filtered_slope, "filtered_slope": bend}


def begin(p: Any, value: Real) -> Mapping[str, Real]:
    return {**({} if p.filter == "none" else {"filtered": value, "filtered_slope": 0.0}), **filled(value)}


def read(p: Any, held: Any, states: Any, sensed: Sensed) -> Reading:
    value = sensed.value if p.filter == "none" else states.filtered
    return delayed(p, held, converted(noisy(p, value, sensed), p.resolution))


SENSOR = Sensor(
    name="tachometer",
    doc=__doc__,
    parameters=(
        Parameter(
            name="filter", shape="word", words=("none", "butterworth"), default="none", doc="the filter behind it"
        ),
        Parameter(name="cutoff", unit="Hz", above=0.0, only=FILTERED, doc="cut-off of the filter"),
        NOISE,
        RESOLUTION,
        DELAY,
    ),
    states=(
        State(name="filtered", unit="of", only=FILTERED, doc="what is behind the filter"),
        State(name="filtered_slope", unit="of/s", only=FILTERED, doc="its slope"),
    ),
    memory=PAST,
    follow=follow,
    begin=begin,
    read=read,
)
