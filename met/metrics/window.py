"""The window of a run that a metric looks at: its samples from `after` on, for the duration `within`.

Both ends belong to it. They are decimals, and so is the time of a sample: four units in the last place are allowed for
the rounding of the three.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import reduce
from typing import Any

from met.metrics.metric import OverJoints
from met.parameter import Parameter
from met.trace import Real, Truth, absolute, both, maximum, minimum, where
from met.vectors import constant

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
