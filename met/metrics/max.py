"""The largest value of the signal in the run, or in a window of it.

It is not a number if the window has no sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import reduce
from typing import Any

from met.metrics.metric import PART, Metric, OverJoints, after_sample, as_channel, extreme_seen
from met.parameter import Memory
from met.trace import Real, maximum


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    return {"most": after_sample(p, t, maximum(held.most, x), held.most, -math.inf)}


def result(p: Any, held: Any, t: Real) -> Real:
    return extreme_seen(p, held.most)


METRIC = Metric(
    name="max",
    doc=__doc__,
    bounds=as_channel,
    extreme="most",
    unit="of",
    parameters=PART,
    over_joints=OverJoints("max", lambda values: reduce(maximum, values)),
    memory=(Memory(name="most", unit="of", doc="largest so far", start=-math.inf),),
    update=update,
    result=result,
)
