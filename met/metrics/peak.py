"""The largest absolute value of the signal in the run, or in a window of it.

It is not a number if the window has no sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import reduce
from typing import Any

from met.metrics.metric import PART, Metric, OverJoints, after_sample, as_size, extreme_seen
from met.parameter import Memory
from met.trace import Real, absolute, maximum


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    return {"most": after_sample(p, t, maximum(held.most, absolute(x)), held.most, -math.inf)}


def result(p: Any, held: Any, t: Real) -> Real:
    return extreme_seen(p, held.most)


METRIC = Metric(
    name="peak",
    doc=__doc__,
    bounds=as_size,
    extreme="most",
    unit="of",
    least=0.0,
    parameters=PART,
    over_joints=OverJoints("peak", lambda values: reduce(maximum, map(absolute, values))),
    memory=(Memory(name="most", unit="of", doc="largest size so far"),),
    update=update,
    result=result,
)
