"""The longest time for which a condition holds without a break in a window of the run, minus `time`.

It is at least 0 if the condition holds at all samples of a stretch of that length: `F G_[0, time]` in signal temporal
logic over the samples (met/metrics/always.py names the sources). The margin is one of time, not of the condition: the
latter, the largest of the smallest margins of all such stretches, would need the memory of a whole stretch in each
case. It is not a number if the window has no sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.metrics.metric import EVERY_JOINT, ROUNDING, WINDOW, Metric, inside
from met.parameter import Memory, Parameter
from met.trace import Real, both, maximum, where


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    """The memory after a sample x, the condition's margin, at t, s: steps that it holds on end, and the longest time,
    s."""
    seen = inside(p, t)
    steps = where(both(seen, x >= 0.0), held.steps + 1.0, -1.0)
    longest = maximum(held.longest, maximum(steps, 0.0) * dt)
    return {"steps": steps, "longest": where(seen, longest, held.longest)}


def result(p: Any, held: Any, t: Real) -> Real:
    margin = held.longest - p.time
    enough = held.longest * (1.0 + ROUNDING) >= p.time
    return where(held.longest == -math.inf, math.nan, where(enough, maximum(margin, 0.0), margin))


METRIC = Metric(
    name="holds_for",
    doc=__doc__,
    unit="s",
    condition=True,
    over_joints=EVERY_JOINT,
    parameters=(Parameter(name="time", unit="s", above=0.0, doc="time for which the condition should hold"), *WINDOW),
    memory=(
        Memory(name="steps", unit="1", doc="samples of the present stretch behind its first; -1 outside", start=-1.0),
        Memory(name="longest", unit="s", doc="longest stretch so far", start=-math.inf),
    ),
    update=update,
    result=result,
)
