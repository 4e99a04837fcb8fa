"""The smallest value of the signal in the run, or in a window of it.

It is not a number if the window has no sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import reduce
from typing import Any

from met.metrics.metric import PART, Metric, OverJoints, after_sample, as_channel, extreme_seen
from met.parameter import Memory
from met.trace import Real, minimum


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    return {"least": after_sample(p, t, minimum(held.least, x), held.least, math.inf)}


def result(p: Any, held: Any, t: Real) -> Real:
    return extreme_seen(p, held.least)


METRIC = Metric(
    name="min",
    doc=__doc__,
    bounds=as_channel,
    extreme="least",
    unit="of",
    parameters=PART,
    over_joints=OverJoints("min", lambda values: reduce(minimum, values)),
    memory=(Memory(name="least", unit="of", doc="smallest so far", start=math.inf),),
    update=update,
    result=result,
)
