"""Accelerometer: the specific force at a point of a link along one direction, through a filter, digitized.

    x        along . (a - g)         a: acceleration of the point `at`;  g: that of a body which falls freely there
    y''      = w^2 (x - y) - sqrt(2) w y',  w = 2 pi cutoff                 of order 2, integrated with the arm
    reading  scale y + bias + noise n_k, to the nearest step of the converter, `delay` ticks late

So at rest under gravity it reads +9.81 m/s^2 upwards, and in free fall zero. g is all of gravitation: uniform
`gravity`, and the share of a `gravity_gradient` at that point. In orbit, an accelerometer away from the centre of mass
therefore does feel the difference. The filter is always present: a real sensor has a bandwidth, and the acceleration at
a tick is not known before the loads that act from that tick on.

A run begins with the filter settled, for joints that do not accelerate and a free base in free fall. The noise is white
from tick to tick. A jump of the rates, as at a grapple of a payload, is not an acceleration here; a real sensor would
ring. The sensor has one axis; for three axes, write three sensors. It has no limited range, and its axis is exactly the
one that is written: there is no misalignment.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import ZEROS, Parameter
from met.sensors import butterworth
from met.sensors.sensor import (
    ALONG,
    BIAS,
    DELAY,
    LINK,
    NOISE,
    PAST,
    RESOLUTION,
    SCALE,
    Felt,
    Reading,
    Sensed,
    Sensor,
    at_rest,
    component,
    filled,
    reading,
)
from met.trace import Real


def measures(p: Any, felt: Felt) -> Real:
    return component(p.along, felt.specific_force(p.link, p.at))


def follow(p: Any, states: Any, value: Real) -> Mapping[str, Real]:
    return butterworth.slopes(p, states, value)


def begin(p: Any, value: Real) -> Mapping[str, Real]:
    return {**butterworth.settled(value), **filled(at_rest(p, value))}


def read(p: Any, held: Any, states: Any, sensed: Sensed) -> Reading:
    return reading(p, held, states.filtered, sensed)


SENSOR = Sensor(
    name="accelerometer",
    doc=__doc__,
    parameters=(
        LINK,
        Parameter(
            name="at", unit="m", shape="vector", default=ZEROS, doc="position of the sensor, in the link's frame"
        ),
        ALONG,
        butterworth.cutoff(),
        SCALE,
        BIAS,
        NOISE,
        RESOLUTION,
        DELAY,
    ),
    states=butterworth.states(),
    memory=PAST,
    measures=measures,
    unit="m/s^2",
    fastest=butterworth.fastest,
    swing=butterworth.swing,
    follow=follow,
    begin=begin,
    read=read,
)
