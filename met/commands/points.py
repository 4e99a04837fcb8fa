"""Curves through points in time, for the profiles that have tables: straight lines, and a cubic spline.

Points are constants, two at least, their times rising. Before the first and after the last their values are held, with
slope zero. A segment is found by bisection over the table of times, one `gather` a turn: 14 turns for 10,000 points,
which all commands with this table share.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from met.instants import has_come
from met.parameter import Limit
from met.trace import Real, Truth, both, clip, either, gather, minimum, not_, where

Numbers = tuple[float, ...]


def segment(times: Numbers, t: Real) -> Real:
    """Number of the segment that holds t: the largest i <= n - 2 with times[i] <= t, 0 before the first point."""
    last = len(times) - 2
    i: Real = 0.0
    stride = 1 << (last.bit_length() - 1) if last > 0 else 0
    while stride > 0:
        further = minimum(i + float(stride), float(last))
        i = where(gather(times, further) <= t, further, i)
        stride //= 2
    return i


def linear(times: Numbers, values: Numbers, t: Real) -> tuple[Real, Real]:
    """Value and slope at t of straight lines through the points; at a point, the slope of the segment that follows."""
    i = segment(times, t)
    t_0, t_1 = gather(times, i), gather(times, i + 1.0)
    v_0, v_1 = gather(values, i), gather(values, i + 1.0)
    slope = (v_1 - v_0) / (t_1 - t_0)
    share = clip((t - t_0) / (t_1 - t_0), 0.0, 1.0)
    return _held(times, values, t, v_0 + (v_1 - v_0) * share, slope)


def cubic(times: Numbers, values: Numbers, t: Real) -> tuple[Real, Real]:
    """Value and slope at t of the clamped cubic spline: C2 between the ends, at rest at both, so C1 with the held
    values.

    It may swing beyond the points' values where these jump.
    """
    slopes = clamped_slopes(times, values)
    i = segment(times, t)
    t_0, v_0, m_0 = (gather(table, i) for table in (times, values, slopes))
    t_1, v_1, m_1 = (gather(table, i + 1.0) for table in (times, values, slopes))
    s, h = t - t_0, t_1 - t_0
    mean = (v_1 - v_0) / h
    b = (3.0 * mean - 2.0 * m_0 - m_1) / h
    c = (m_0 + m_1 - 2.0 * mean) / (h * h)
    return _held(times, values, t, v_0 + s * (m_0 + s * (b + s * c)), m_0 + s * (2.0 * b + 3.0 * s * c))


def clamped_slopes(times: Sequence[float], values: Sequence[float]) -> Numbers:
    """Slopes at the points of the cubic spline whose second derivative is continuous and whose ends are at rest.

    With h the lengths of the segments and m the slopes, for every inner point (de Boor, A Practical Guide to Splines,
    1978, ch. IV; divided by h_(i-1) h_i there):

        h_i m_(i-1) + 2 (h_(i-1) + h_i) m_i + h_(i-1) m_(i+1) = 3 (h_i d_(i-1) + h_(i-1) d_i),   d the mean slopes

    The diagonal dominates, so elimination without pivoting is stable.
    """
    n = len(times)
    h = [times[k + 1] - times[k] for k in range(n - 1)]
    mean = [(values[k + 1] - values[k]) / h[k] for k in range(n - 1)]
    above, right = [0.0] * n, [0.0] * n
    for k in range(1, n - 1):
        diagonal = 2.0 * (h[k - 1] + h[k]) - h[k] * above[k - 1]
        above[k] = h[k - 1] / diagonal
        right[k] = (3.0 * (h[k] * mean[k - 1] + h[k - 1] * mean[k]) - h[k] * right[k - 1]) / diagonal
    slopes = [0.0] * n
    for k in range(n - 2, 0, -1):
        slopes[k] = right[k] - above[k] * slopes[k + 1]
    return tuple(slopes)


def ends(time_of: Callable[[Any, Any], Real]) -> Limit:
    """The limit of a model with points at `p.times`: it is reached outside of them. time_of: (p, t or world) -> time in
    the table, s."""

    def beyond(p: Any, instant: Any) -> Truth:
        time = time_of(p, instant)
        return either(not_(has_come(time, p.times[0])), has_come(time, p.times[-1]))

    return Limit(parameter="times", reached=beyond)


def _held(times: Numbers, values: Numbers, t: Real, value: Real, slope: Real) -> tuple[Real, Real]:
    """Value and slope of a curve between its ends; outside of them exactly the ends' values, and slope 0."""
    value = where(t >= times[-1], values[-1], where(t < times[0], values[0], value))
    return value, where(both(t >= times[0], t < times[-1]), slope, 0.0)
