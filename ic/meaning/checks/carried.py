"""Pulses of commands and courses whose size is wrong in the samples at their instants.

What is sampled is held until the next instant, or is taken as the mean of a step's two ends: of a pulse between two
zeros both make the sum of the samples times the interval. The integral of a rate is a way, that of a torque an impulse;
of a position, the peak is what counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from met.content import Hump, humps_from_zero, humps_of_turns
from met.frozen import frozen

OFF = 0.05
"""Largest relative error of an integral, or a peak."""

FEW = 20.0
"""Number of intervals in a pulse from which on its integral is within `OFF`: half an interval at each end."""

SLIGHT = 0.1
"""Share of the largest pulse below which another is ignored."""

ROUNDING = 1e-9
"""Share of an interval by which an instant may miss its time."""


@frozen
class Uncarried:
    """A pulse with a wrong size in samples: from and until, s; its true integral, or peak, and the sampled one."""

    begins: float
    ends: float
    truth: float
    seen: float

    @property
    def off(self) -> float:
        """Relative error of the sampled size."""
        return abs(self.seen / self.truth - 1.0)


def uncarried(
    points: Sequence[tuple[float, float]], interval: float, duration: float, *, integral: bool
) -> list[Uncarried]:
    """The pulses of a course (a value as a function of time) of straight lines whose size is wrong in samples at this
    interval, s.

    integral  whether the integral counts, else the peak
    """
    if len(points) < 2:
        return []
    inner = [hump for hump in humps_of_turns(points) if hump.times[0] >= 0.0 and hump.times[-1] <= duration]
    known = {(float(pulse.times[0]), float(pulse.times[-1])) for pulse in inner}
    from_zero = humps_from_zero(points, duration) if integral else ()
    every = [*inner, *(pulse for pulse in from_zero if (float(pulse.times[0]), float(pulse.times[-1])) not in known)]
    truths = [pulse.impulse if integral else float(pulse.heights.max()) for pulse in every]
    least = SLIGHT * max(truths, default=0.0)
    looked_at = ((hump, truth) for hump, truth in zip(every, truths, strict=True) if truth > least)
    return [pulse for pulse in _judged(looked_at, interval, duration, integral) if pulse.off > OFF]


def _judged(
    humps: Iterable[tuple[Hump, float]], interval: float, duration: float, integral: bool
) -> Iterator[Uncarried]:
    """Compare each hump of a course (a value as a function of time) with its samples at this interval, s: its height
    with theirs, or its integral with theirs where `integral` is set."""
    for hump, truth in humps:
        begins, ends = float(hump.times[0]), float(hump.times[-1])
        if integral and ends - begins > FEW * interval:
            continue
        first, last = math.ceil(begins / interval - ROUNDING), math.floor(ends / interval + ROUNDING)
        if integral and duration <= last * interval * (1.0 + ROUNDING):
            last -= 1  # nothing is held from the run's end on
        instants = np.clip(np.arange(first, last + 1) * interval, begins, ends)
        heights = hump.at(instants)
        seen = interval * float(heights.sum()) if integral else float(heights.max(initial=0.0))
        yield Uncarried(begins, ends, truth, seen)
