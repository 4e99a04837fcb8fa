"""Rate gyroscope: the angular velocity of a link about one direction, through an optional filter, digitized.

    x        along . w               w: angular velocity against directions that do not turn
    filter = none          y = x
    filter = butterworth   y'' = w_c^2 (x - y) - sqrt(2) w_c y',  w_c = 2 pi cutoff  of order 2, integrated with the arm
    reading  scale y + bias + noise n_k, to the nearest step of the converter, `delay` ticks late

If the world itself turns, as with a `gravity_gradient` whose frame is orbital, its rotation is included in the reading.
A run begins with the filter settled. The noise is white from tick to tick; the bias is constant: there is no drift. The
sensor does not integrate the rate to an angle, and does not feel accelerations.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.sensors.sensor import (
    ALONG,
    BIAS,
    CUTOFF,
    DELAY,
    FILTER,
    LINK,
    NOISE,
    PAST,
    RESOLUTION,
    SCALE,
    STATES,
    Felt,
    Reading,
    Sensed,
    Sensor,
    at_rest,
    behind,
    component,
    fastest,
    filled,
    follow,
    reading,
    settled,
    swing,
)
from met.trace import Real


def measures(p: Any, felt: Felt) -> Real:
    return component(p.along, felt.spin(p.link))


def begin(p: Any, value: Real) -> Mapping[str, Real]:
    return {**settled(p, value), **filled(at_rest(p, value))}


def read(p: Any, held: Any, states: Any, sensed: Sensed) -> Reading:
    return reading(p, held, behind(p, states, sensed), sensed)


SENSOR = Sensor(
    name="gyroscope",
    doc=__doc__,
    parameters=(
        LINK,
        ALONG,
        FILTER,
        CUTOFF,
        SCALE,
        BIAS,
        NOISE,
        RESOLUTION,
        DELAY,
    ),
    states=STATES,
    memory=PAST,
    measures=measures,
    unit="rad/s",
    fastest=fastest,
    swing=swing,
    follow=follow,
    begin=begin,
    read=read,
)
