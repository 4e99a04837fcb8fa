"""A metric as far from its samples as the signal may have taken it between them: a cautious bound of what they miss.

Of an extreme: about each sample that is larger than both of its neighbours, the signal is taken to rise on the straight
line through the two samples before, and to fall on that through the two behind, and may reach where these meet. This
holds for a signal with a kink there, such as a rate at a stop, and is at least twice what a parabola has beyond its
samples. A metric that is not an extreme says itself how far it may be off (`Metric.furthest`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from met.metrics.metric import Metric
from met.parameter import Memory
from met.trace import Real, maximum, minimum, where

SAMPLES = tuple(
    Memory(name=f"sample_{number}", unit="of", doc=f"sample {number} before this one", start=-math.inf)
    for number in (1, 2, 3, 4)
)


def furthest(metric: Metric) -> Metric | None:
    """The metric with the furthest values between its samples; None where it is neither an extreme of samples nor says
    how far it may be off."""
    name = metric.extreme or (metric.memory[0].name if metric.margin and metric.unit == "of" else "")
    if metric.furthest is not None or not name:
        return metric.furthest
    start = next(memory.start for memory in metric.memory if memory.name == name)
    sign = -1.0 if start == math.inf else 1.0

    def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
        own = {memory.name: getattr(held, memory.name) for memory in metric.memory}
        new = dict(metric.update(p, held, x, t, dt))
        alone = metric.update(p, Held(**own | {name: start}), x, t, dt)[name]
        samples = [getattr(held, sample.name) for sample in SAMPLES]
        reached = samples[1] + beyond(sign * alone, *samples)
        new[name] = sign * maximum(sign * new[name], reached)
        before = (sign * alone, *samples[:3])
        return new | {sample.name: value for sample, value in zip(SAMPLES, before, strict=True)}

    return replace(metric, memory=(*metric.memory, *SAMPLES), update=update)


STEEPER = 2.0
"""The largest factor by which a signal may become steeper from one sample to the next towards its extreme; what is
steeper still is a jump, such as that of a torque at a servo's tick, and does not go on."""


class Held:
    """Values by name, as a metric reads its memory."""

    def __init__(self, **values: Real) -> None:
        self.__dict__.update(values)


def beyond(last: Real, d: Real, c: Real, b: Real, a: Real) -> Real:
    """How far the signal may be above the sample c, of five from a to the last one, at most one sample away; 0 where a
    neighbour is above it, or one of the five is not finite."""
    rise, rise_before, fall, fall_after = c - b, b - a, c - d, d - last

    def meeting(up: Real, down: Real, other: Real) -> Real:
        slopes = up + down
        height = up * (down - other) / where(slopes > 0.0, slopes, 1.0)
        return where((up > 0.0) & (down > other) & (height < math.inf), height, 0.0)

    excess = maximum(
        meeting(minimum(rise, STEEPER * rise_before), fall_after, fall),
        meeting(minimum(fall, STEEPER * fall_after), rise_before, rise),
    )
    return where((rise >= 0.0) & (fall >= 0.0), excess, 0.0)
