"""Common parts of sensors of links: the link, a direction on it, a scale and a bias."""

from __future__ import annotations

from typing import Any

from met.parameter import BASE, Parameter
from met.sensors.sensor import Reading, Sensed, converted, delayed, noisy
from met.trace import Real, sqrt
from met.vectors import Vector, dot, scale

LINK = Parameter(name="link", shape="word", names="link", words=(BASE,), doc="link that the sensor is fixed to")
ALONG = Parameter(
    name="along",
    shape="vector",
    direction=True,
    doc="measured direction, in the link's frame; the length of the vector does not matter",
)
SCALE = Parameter(
    name="scale",
    default=1.0,
    doc="reading per unit of the measured quantity: with 1.01 the sensor reads one per cent more",
)
BIAS = Parameter(name="bias", unit="of", default=0.0, doc="reading at zero of the measured quantity")


def component(along: Vector, vector: Vector) -> Real:
    """The component of a vector along a direction of any length."""
    return dot(scale(1.0 / sqrt(dot(along, along)), along), vector)


def reading(p: Any, held: Any, value: Real, sensed: Sensed) -> Reading:
    """A value with scale, bias and the tick's noise, to the nearest step of the converter, `delay` ticks late."""
    return delayed(p, held, converted(noisy(p, p.scale * value + p.bias, sensed), p.resolution))


def at_rest(p: Any, value: Real) -> Real:
    """The reading at the start of a run, without noise."""
    return converted(p.scale * value + p.bias, p.resolution)
