"""The mean over time, by the trapezoidal rule; of a run that has no length, its one value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.metrics import Metric
from met.parameter import Memory
from met.trace import Real, where


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    return {"area": held.area + dt * 0.5 * (held.last + x), "last": x, "until": t}


def result(p: Any, held: Any, t: Real) -> Real:
    length = where(held.until > 0.0, held.until, 1.0)  # `where` computes both sides: never divide by what may be zero
    return where(held.until > 0.0, held.area / length, held.last)


METRIC = Metric(
    name="mean",
    doc=__doc__,
    unit="of",
    memory=(
        Memory(name="area", unit="of*s", doc="integral so far"),
        Memory(name="last", unit="of", doc="latest value"),
        Memory(name="until", unit="s", doc="time of the latest value"),
    ),
    update=update,
    result=result,
)
