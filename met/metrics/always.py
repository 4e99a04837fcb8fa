"""The smallest margin of a condition in a window of the run: at least 0 if the condition holds at every sample in it.

This is the robustness of `G_[after, after + within]` in signal temporal logic over the samples: how far every value may
move, in the unit of the condition, before the answer changes. It is not a number if the window has no sample.

A. Donze, O. Maler, Robust satisfaction of temporal logic over real-valued signals, FORMATS 2010; G. E. Fainekos, G. J.
Pappas, Robustness of temporal logic specifications for continuous-time signals, Theoretical Computer Science 410, 2009.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.metrics.metric import EVERY_JOINT, WINDOW, Metric, as_channel, inside
from met.parameter import Memory
from met.trace import Real, minimum, where


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    return {"least": where(inside(p, t), minimum(held.least, x), held.least)}


def result(p: Any, held: Any, t: Real) -> Real:
    return where(held.least == math.inf, math.nan, held.least)


METRIC = Metric(
    name="always",
    doc=__doc__,
    bounds=as_channel,
    unit="of",
    condition=True,
    over_joints=EVERY_JOINT,
    parameters=WINDOW,
    memory=(Memory(name="least", unit="of", doc="least margin so far", start=math.inf),),
    update=update,
    result=result,
)
