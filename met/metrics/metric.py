"""The declaration of a metric: one number about one channel over a whole run, or over a window of it.

It sees its channel at every tick of the channel's owner (the dynamics' for motion and torque, the servo's for its
computer's memory), whatever is recorded, so its value does not depend on the record.

Both ends of a window belong to it. They are decimals, and so is the time of a sample: four units in the last place are
allowed for the rounding of the three.

`furthest` takes an extreme as far from its samples as the signal may have been between them. About each sample that is
larger than both of its neighbours, the signal is taken to rise on the straight line through the two samples before, and
to fall on that through the two behind, and may reach where these meet. This holds for a signal with a kink there, such
as a rate at a stop, and is at least twice what a parabola has beyond its samples. A metric that is not an extreme says
itself how far it may be off (`Metric.furthest`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

from met.frozen import frozen
from met.parameter import Declaration, Memory, Parameter
from met.trace import Real, Truth, absolute, both, maximum, minimum, where
from met.vectors import constant


@frozen
class OverJoints:
    """The number that a metric about several joints watches: one computed from theirs, at each sample.

    word  what it is called: `max(*.servo.voltage)`
    of    the joints' numbers, one or more -> that number
    """

    word: str
    of: Callable[[list[Real]], Real]


@frozen(kw_only=True)
class Metric(Declaration):
    """The declaration of a metric; one a file.

    unit    of the result: "of" is the channel's, "s" a time, "1" a pure number
    share   whether it is part of a whole, seldom above 1: a limit above that without a `%` is warned of
    least   bound below which it never is; a requirement that cannot be missed, or met, is warned of
    bounds  (least, most of the channel) -> least and most of the metric; None: the channel's bounds say nothing of it
    times   whether it is an instant of the run, or infinite: a limit after the run's end is warned of
    target  the parameter that is the value to be reached, where there is one: a command that comes to it after the
            run's end is warned of
    extreme  the memory that has another value where the channel comes to a new extreme, which is what the metric says;
            "": it says no extreme
    undefined  (p, first) -> why it is no number where its channel begins with this value, in words; "": it is one.
            None: it always is
    condition    whether it watches the margin of a condition, at least 0 where that holds. Where it is no `share` it is
                 a margin itself: a requirement without a limit is that it is at least 0
    over_joints  what it watches of several joints; None: it watches one channel
    between  the same metric told between samples, which moves as its channel does and is within a sample of this one;
             for one that moves in steps of a sample, whose gradient is that one's. None: this one moves by itself
    furthest  the same metric with what it may be off by between samples added; None: it is not off, or says an extreme,
              of which `furthest` finds it
    update  (p, held, x, t, dt) -> new memory: x the channel at time t (s), dt s since the sample before (0 at first)
    result  (p, held, t) -> the metric, at the run's last sample, time t
    """

    unit: str
    share: bool = False
    least: float = -math.inf
    bounds: Callable[[float, float], tuple[float, float]] | None = None
    times: bool = False
    target: str = ""
    extreme: str = ""
    undefined: Callable[[Any, float], str] | None = None
    condition: bool = False
    over_joints: OverJoints | None = None
    between: Metric | None = None
    furthest: Metric | None = None
    memory: tuple[Memory, ...]
    update: Callable[[Any, Any, Real, Real, Real], Mapping[str, Real]]
    result: Callable[[Any, Any, Real], Real]

    @property
    def margin(self) -> bool:
        """True if it is the margin of a condition, which should be large."""
        return self.condition and not self.share


def as_channel(least: float, most: float) -> tuple[float, float]:
    """Bounds of a metric that is a value of its channel."""
    return least, most


def as_size(least: float, most: float) -> tuple[float, float]:
    """Bounds of a metric that is a size of its channel, or a mean of sizes."""
    return max(least, -most, 0.0), max(-least, most)


AFTER = Parameter(name="after", unit="s", default=0.0, at_least=0.0, doc="start of the time window that is evaluated")
WITHIN = Parameter(
    name="within", unit="s", default=math.inf, at_least=0.0, doc="length of the time window that is evaluated"
)
WINDOW = (AFTER, WITHIN)

PART = tuple(replace(parameter, timing=True) for parameter in WINDOW)
"""The window of a metric that watches the whole run unless the deck sets one. Only then is it in plan and program."""

EVERY_JOINT = OverJoints("every", lambda margins: reduce(minimum, margins))
ANY_JOINT = OverJoints("any", lambda margins: reduce(maximum, margins))

ROUNDING = 4.0 * 2.0**-52


def inside(p: Any, t: Real) -> Truth:
    """True at samples in the window."""
    return both(t >= p.after * (1.0 - ROUNDING), t <= (p.after + p.within) * (1.0 + ROUNDING))


def is_whole(p: Any) -> bool:
    """True where the window is known to be the whole run."""
    return constant(p.after) and constant(p.within) and p.after == 0.0 and p.within == math.inf


def after_sample(p: Any, t: Real, new: Real, held: Real, start: Real) -> Real:
    """The memory of a metric after a sample at t: `new` if the sample is in the window, else what was held. Before the
    window it is `start`."""
    return new if is_whole(p) else where(inside(p, t), new, where(t < p.after, start, held))


def extreme_seen(p: Any, extreme: Real) -> Real:
    """An extreme whose memory starts at infinity; not a number if the window has no sample."""
    return extreme if is_whole(p) else where(absolute(extreme) < math.inf, extreme, math.nan)


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
        """The memory of the metric after a sample x at t, s, taken as far as the signal may have gone between
        samples."""
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
    """The most by which the signal may be above the sample c, of five from a to the last one, at most one sample away;
    0 where a neighbour is above it, or one of the five is not finite."""
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
