"""Encoder: it counts lines, and reads the last one that was passed.

    reading = step floor(x/step),  `delay` ticks late

so the reading is half a step too small on average. No count is ever lost. A rate that is found from counts is not part
of this model.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter
from met.sensors.sensor import DELAY, PAST, Reading, Sensed, Sensor, delayed, filled
from met.trace import Real, floor


def begin(p: Any, value: Real) -> Mapping[str, Real]:
    return filled(p.step * floor(value / p.step))


def read(p: Any, held: Any, states: Any, sensed: Sensed) -> Reading:
    return delayed(p, held, p.step * floor(sensed.value / p.step))


SENSOR = Sensor(
    name="encoder",
    doc=__doc__,
    parameters=(Parameter(name="step", unit="of", above=0.0, doc="distance from one line to the next"), DELAY),
    memory=PAST,
    begin=begin,
    read=read,
)
