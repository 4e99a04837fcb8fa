"""The share of a window of the run in which a condition holds: the share of its samples with a margin of at least 0.

It is not a number if the window has no sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.metrics.metric import Metric
from met.metrics.window import EVERY_JOINT, WINDOW, inside
from met.parameter import Memory
from met.trace import Real, both, where


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    seen = inside(p, t)
    return {
        "met": held.met + where(both(seen, x >= 0.0), 1.0, 0.0),
        "count": held.count + where(seen, 1.0, 0.0),
    }


def result(p: Any, held: Any, t: Real) -> Real:
    return held.met / held.count


METRIC = Metric(
    name="share_of_time",
    doc=__doc__,
    unit="1",
    share=True,
    least=0.0,
    condition=True,
    over_joints=EVERY_JOINT,
    parameters=WINDOW,
    memory=(
        Memory(name="met", unit="1", doc="samples at which it holds"),
        Memory(name="count", unit="1", doc="samples"),
    ),
    update=update,
    result=result,
)
