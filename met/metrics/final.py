"""The value of the signal at the end of the run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.metrics.metric import Metric, as_channel
from met.parameter import Memory
from met.trace import Real


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    return {"last": x}


def result(p: Any, held: Any, t: Real) -> Real:
    return held.last


METRIC = Metric(
    name="final",
    doc=__doc__,
    bounds=as_channel,
    unit="of",
    memory=(Memory(name="last", unit="of", doc="latest value"),),
    update=update,
    result=result,
)
