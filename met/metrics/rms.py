"""The root mean square of the signal over its samples, or over those in a window of the run.

It is not a number if the window has no sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.metrics.metric import PART, Metric, OverJoints, after_sample, as_size
from met.parameter import Memory
from met.trace import Real, sqrt


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    """The memory after a sample x at t, s: the sum of squares and the count in the window."""
    return {
        "squares": after_sample(p, t, held.squares + x * x, held.squares, 0.0),
        "count": after_sample(p, t, held.count + 1.0, held.count, 0.0),
    }


def result(p: Any, held: Any, t: Real) -> Real:
    return sqrt(held.squares / held.count)


def root_mean_square(values: list[Real]) -> Real:
    """The root mean square of the joints at one sample: over all samples, it gives that over samples and joints."""
    total: Real = 0.0
    for value in values:
        total = total + value * value
    return sqrt(total / len(values))


METRIC = Metric(
    name="rms",
    doc=__doc__,
    bounds=as_size,
    unit="of",
    least=0.0,
    parameters=PART,
    over_joints=OverJoints("rms", root_mean_square),
    memory=(
        Memory(name="squares", unit="1", doc="sum of squares"),
        Memory(name="count", unit="1", doc="samples"),
    ),
    update=update,
    result=result,
)
