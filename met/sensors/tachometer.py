"""Tachometer, or any analog sensor: a filter, then noise, a converter and a delay.

    filter = none          y = x
    filter = butterworth   y'' = w^2 (x - y) - sqrt(2) w y',  w = 2 pi cutoff       of order 2, integrated with the arm
    reading                y + noise n_k, to the nearest step of the converter, `delay` ticks late

x is the quantity that is sensed, a rate or any other. The noise is white from tick to tick, so its share below a given
frequency depends on the servo's rate. A run begins with the filter settled. There is no ripple, as a resolver would
have.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.sensors.sensor import (
    CUTOFF,
    DELAY,
    FILTER,
    NOISE,
    PAST,
    RESOLUTION,
    STATES,
    Reading,
    Sensed,
    Sensor,
    behind,
    converted,
    delayed,
    fastest,
    filled,
    follow,
    noisy,
    settled,
    swing,
)
from met.trace import Real


def begin(p: Any, value: Real) -> Mapping[str, Real]:
    return {**settled(p, value), **filled(value)}


def read(p: Any, held: Any, states: Any, sensed: Sensed) -> Reading:
    return delayed(p, held, converted(noisy(p, behind(p, states, sensed), sensed), p.resolution))


SENSOR = Sensor(
    name="tachometer",
    doc=__doc__,
    parameters=(
        FILTER,
        CUTOFF,
        NOISE,
        RESOLUTION,
        DELAY,
    ),
    states=STATES,
    memory=PAST,
    fastest=fastest,
    swing=swing,
    follow=follow,
    begin=begin,
    read=read,
)
