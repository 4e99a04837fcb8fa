"""The smallest value of the signal in the run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import reduce
from typing import Any

from met.metrics.metric import Metric, OverJoints, as_channel
from met.parameter import Memory
from met.trace import Real, minimum


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    return {"least": minimum(held.least, x)}


def result(p: Any, held: Any, t: Real) -> Real:
    return held.least


METRIC = Metric(
    name="min",
    doc=__doc__,
    bounds=as_channel,
    extreme="least",
    unit="of",
    over_joints=OverJoints("min", lambda values: reduce(minimum, values)),
    memory=(Memory(name="least", unit="of", doc="smallest so far", start=math.inf),),
    update=update,
    result=result,
)
