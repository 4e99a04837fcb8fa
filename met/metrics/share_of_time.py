"""The share of a window of the run in which a condition holds: the share of its samples with a margin of at least 0.

It is not a number if the window has no sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.metrics.metric import EVERY_JOINT, WINDOW, Metric, inside
from met.parameter import Memory
from met.trace import Real, both, where

MEMORY = (
    Memory(name="met", unit="1", doc="samples at which it holds"),
    Memory(name="count", unit="1", doc="samples"),
)


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    """The memory after a sample x, the condition's margin, at t, s: samples in the window, and those where it holds."""
    seen = inside(p, t)
    return {
        "met": held.met + where(both(seen, x >= 0.0), 1.0, 0.0),
        "count": held.count + where(seen, 1.0, 0.0),
    }


def result(p: Any, held: Any, t: Real) -> Real:
    return held.met / held.count


def update_furthest(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    """The memory after a sample, with a sample added wherever the condition begins or ceases to hold between two."""
    new = update(p, held, x, t, dt)
    met = new["met"] - held.met
    turned = both(held.count > 0.0, both(new["count"] > held.count, met != held.last))
    return {"met": new["met"] + where(turned, 1.0, 0.0), "count": new["count"], "last": met}


METRIC = Metric(
    name="share_of_time",
    doc=__doc__,
    unit="1",
    share=True,
    least=0.0,
    condition=True,
    over_joints=EVERY_JOINT,
    parameters=WINDOW,
    furthest=Metric(
        name="share_of_time",
        doc=__doc__,
        unit="1",
        parameters=WINDOW,
        memory=(*MEMORY, Memory(name="last", unit="1", doc="1 where it holds at the sample before, else 0")),
        update=update_furthest,
        result=result,
    ),
    memory=MEMORY,
    update=update,
    result=result,
)
