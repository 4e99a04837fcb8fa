"""The largest margin of a condition in a window of the run: at least 0 if the condition holds at one sample in it, or
more.

This is the robustness of `F_[after, after + within]` in signal temporal logic over the samples (met/metrics/always.py
names the sources). It is not a number if the window has no sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.metrics.metric import EVERY_JOINT, WINDOW, Metric, as_channel, inside
from met.parameter import Memory
from met.trace import Real, maximum, where


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    return {"most": where(inside(p, t), maximum(held.most, x), held.most)}


def result(p: Any, held: Any, t: Real) -> Real:
    return where(held.most == -math.inf, math.nan, held.most)


METRIC = Metric(
    name="eventually",
    doc=__doc__,
    bounds=as_channel,
    unit="of",
    condition=True,
    over_joints=EVERY_JOINT,
    parameters=WINDOW,
    memory=(Memory(name="most", unit="of", doc="greatest margin so far", start=-math.inf),),
    update=update,
    result=result,
)
