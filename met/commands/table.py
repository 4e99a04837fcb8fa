"""Straight lines through points in time; the first value before the first point, the last after the last."""

from __future__ import annotations

from typing import Any

from met.commands.profile import Profile
from met.parameter import Parameter
from met.trace import Real, both, clip, gather, where


def course(p: Any, t: Real) -> tuple[Real, Real]:
    times, values = p.times, p.values
    if len(times) == 1:
        return values[0], 0.0
    last = len(times) - 2
    i: Real = 0.0  # index of the segment: the largest i <= last with times[i] <= t, by bisection over powers of two
    stride = 1 << (last.bit_length() - 1) if last > 0 else 0
    while stride > 0:
        further = i + float(stride)
        there = both(further <= float(last), gather(times, clip(further, 0.0, float(last))) <= t)
        i = where(there, further, i)
        stride //= 2
    t_0, t_1 = gather(times, i), gather(times, i + 1.0)
    v_0, v_1 = gather(values, i), gather(values, i + 1.0)
    slope = (v_1 - v_0) / (t_1 - t_0)
    inside = both(t >= times[0], t < times[-1])
    share = clip((t - t_0) / (t_1 - t_0), 0.0, 1.0)
    return v_0 + (v_1 - v_0) * share, where(inside, slope, 0.0)


PROFILE = Profile(
    name="table",
    doc=__doc__,
    parameters=(
        Parameter(name="times", unit="s", shape="list", doc="times of the points, rising"),
        Parameter(name="values", unit="command", shape="list", doc="values at those times, as many"),
    ),
    course=course,
)
