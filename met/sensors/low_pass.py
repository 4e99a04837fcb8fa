"""Analog low-pass of order 1: y' = 2 pi cutoff (x - y). A continuous law can read it. A run begins with the filter
settled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter, State
from met.sensors.sensor import Reading, Sensed, Sensor
from met.trace import Real


def follow(p: Any, states: Any, value: Real) -> Mapping[str, Real]:
    return {"filtered": 2.0 * math.pi * p.cutoff * (value - states.filtered)}


def fastest(p: Any) -> Real:
    rate: Real = 2.0 * math.pi * p.cutoff
    return rate


def begin(p: Any, value: Real) -> Mapping[str, Real]:
    return {"filtered": value}


def read(p: Any, held: Any, states: Any, sensed: Sensed) -> Reading:
    return Reading(states.filtered)


SENSOR = Sensor(
    name="low_pass",
    doc=__doc__,
    parameters=(Parameter(name="cutoff", unit="Hz", above=0.0, doc="cut-off frequency of the filter"),),
    states=(State(name="filtered", unit="of", doc="output of the filter"),),
    fastest=fastest,
    follow=follow,
    begin=begin,
    read=read,
    clocked=False,
)
