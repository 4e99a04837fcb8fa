"""The least amount by which a condition is missed in a window of the run: at least 0 if it holds at no sample in it.

This is the smallest margin of the condition's opposite, `G_[after, after + within] not` in signal temporal logic over
the samples (met/metrics/always.py names the sources). It is not a number if the window has no sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.metrics.metric import ANY_JOINT, WINDOW, Metric, inside
from met.parameter import Memory
from met.trace import Real, maximum, where


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    return {"most": where(inside(p, t), maximum(held.most, x), held.most)}


def result(p: Any, held: Any, t: Real) -> Real:
    return where(held.most == -math.inf, math.nan, -held.most)


METRIC = Metric(
    name="never",
    doc=__doc__,
    unit="of",
    condition=True,
    over_joints=ANY_JOINT,
    parameters=WINDOW,
    memory=(Memory(name="most", unit="of", doc="greatest margin so far", start=-math.inf),),
    update=update,
    result=result,
)
