"""The largest excursion of the signal beyond its target, as a share of the way from its first value to the target.

It is zero if the signal comes within 2 % of the way and never passes the target, and infinite if it does not come so
near: a signal that has not arrived has not overshot. It is not a number if the signal starts on the target.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.metrics.metric import Metric
from met.parameter import Memory, Parameter
from met.trace import Real, absolute, maximum, where

NEAR = 0.02  # of the way: a signal this near has reached the target, as with a settling time's default band


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    first = where(held.count == 0.0, x, held.first)
    beyond = where(p.target >= first, x - p.target, p.target - x)
    return {"first": first, "beyond": maximum(held.beyond, beyond), "count": held.count + 1.0}


def result(p: Any, held: Any, t: Real) -> Real:
    way = absolute(p.target - held.first)
    over = held.beyond / way
    return where(way > 0.0, where(over >= -NEAR, maximum(over, 0.0), math.inf), math.nan)


METRIC = Metric(
    name="overshoot",
    doc=__doc__,
    extreme="beyond",
    unit="1",
    share=True,
    least=0.0,
    target="target",
    undefined=lambda p, first: "it begins on its target" if first == p.target else "",
    parameters=(Parameter(name="target", unit="of", doc="target value of the signal"),),
    memory=(
        Memory(name="first", unit="of", doc="first value"),
        Memory(name="beyond", unit="of", doc="furthest beyond the target so far, below 0 short of it", start=-math.inf),
        Memory(name="count", unit="1", doc="samples"),
    ),
    update=update,
    result=result,
)
