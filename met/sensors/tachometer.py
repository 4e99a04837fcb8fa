"""Tachometer, or any analog sensor: a filter, then noise, a converter and a delay.

    filter = none          y = x
    filter = butterworth   y'' = w^2 (x - y) - sqrt(2) w y',  w = 2 pi cutoff       of order 2, integrated with the arm
    reading                y + noise n_k, to the nearest step of the converter, `delay` ticks late

x is the quantity that it is of, a rate or any other. The noise is white from tick to tick, so its share below some
frequency depends on the servo's rate. A run begins with the filter settled. Not a resolver: it has no ripple.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter
from met.sensors import butterworth
from met.sensors.digital import DELAY, NOISE, PAST, RESOLUTION, converted, delayed, filled, noisy
from met.sensors.sensor import Reading, Sensed, Sensor
from met.trace import Real

FILTERED = ("filter", ("butterworth",))


def follow(p: Any, states: Any, value: Real) -> Mapping[str, Real]:
    return {} if p.filter == "none" else butterworth.slopes(p, states, value)


def fastest(p: Any) -> Real | None:
    return None if p.filter == "none" else butterworth.fastest(p)


def swing(p: Any) -> tuple[Real, Real] | None:
    return None if p.filter == "none" else butterworth.swing(p)


def begin(p: Any, value: Real) -> Mapping[str, Real]:
    return {**({} if p.filter == "none" else butterworth.settled(value)), **filled(value)}


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
        butterworth.cutoff(FILTERED),
        NOISE,
        RESOLUTION,
        DELAY,
    ),
    states=butterworth.states(FILTERED),
    memory=PAST,
    fastest=fastest,
    swing=swing,
    follow=follow,
    begin=begin,
    read=read,
)
