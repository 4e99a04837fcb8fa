"""Steps of a number on its way into a computer: noise, the converter's resolution, and ticks of delay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Memory, Parameter
from met.sensors.sensor import Reading, Sensed
from met.trace import Real, rint, where

MOST = 3
"""Largest delay in ticks."""

NOISE = Parameter(name="noise", unit="of", default=0.0, at_least=0.0, doc="white noise that is added at each tick, rms")
RESOLUTION = Parameter(
    name="resolution",
    unit="of",
    default=0.0,
    at_least=0.0,
    doc="step of the converter, which rounds to the nearest one; 0: no rounding",
)
DELAY = Parameter(
    name="delay",
    default=0.0,
    at_least=0.0,
    at_most=float(MOST),
    whole=True,
    doc="ticks by which the reading is late",
)
PAST = tuple(Memory(name=f"past_{n}", unit="of", doc=f"reading {n} ticks before the last") for n in range(MOST))


def noisy(p: Any, value: Real, sensed: Sensed) -> Real:
    """The value with the noise of this tick."""
    return value + where(p.noise > 0.0, p.noise * sensed.draw(), 0.0)


def converted(x: Real, resolution: Real) -> Real:
    """The value rounded to the nearest of a converter's steps; unchanged where the resolution is 0."""
    step = where(resolution > 0.0, resolution, 1.0)
    return where(resolution > 0.0, step * rint(x / step), x)


def delayed(p: Any, held: Any, value: Real) -> Reading:
    """The reading of `delay` ticks ago, and the queue one tick on."""
    queue = [value, *(getattr(held, memory.name) for memory in PAST)]
    seen = value
    for ago in range(1, MOST + 1):
        seen = where(p.delay == float(ago), queue[ago], seen)
    return Reading(seen, {memory.name: queue[n] for n, memory in enumerate(PAST)})


def filled(value: Real) -> Mapping[str, Real]:
    """The queue at the start of a run."""
    return {memory.name: value for memory in PAST}
