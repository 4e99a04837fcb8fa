"""The tachometer's filter, a Butterworth low-pass of order 2, exactly, for rates that are known between the ends.

    y' = z,   z' = wc^2 (u - y) - sqrt(2) wc z,   wc = 2 pi f_cut

Decay and frequency of its free motion are both sigma = wc/sqrt(2). Its response to a straight line or an exponential is
that motion about the course that follows the input: no step size is involved.
"""

from __future__ import annotations

import math

from met.frozen import frozen
from met.trace import Real, cos, exp, sin

State = tuple[Real, Real]
"""State of the filter: y rad/s (filtered rate) and z = y' rad/s^2."""


@frozen
class Filter:
    """The filter over one length of time: its free motion, and sigma.

    free  [[y from y, y from z], [z from y, z from z]]
    """

    sigma: Real
    time: Real
    free: tuple[tuple[Real, Real], tuple[Real, Real]]


def over(f_cut: Real, time: Real) -> Filter:
    """The filter with a cut-off frequency (Hz, 1/s) over a time (s)."""
    sigma = math.sqrt(2.0) * math.pi * f_cut
    fading, c, s = exp(-sigma * time), cos(sigma * time), sin(sigma * time)
    rows = ((fading * (c + s), fading * s / sigma), (-2.0 * sigma * (fading * s), fading * (c - s)))
    return Filter(sigma, time, rows)


def _about(lowpass: Filter, x: State, before: State, after: State) -> State:
    """The state at the end: free motion about a course that begins at `before` and ends at `after`."""
    y, z = x[0] - before[0], x[1] - before[1]
    (yy, yz), (zy, zz) = lowpass.free
    return after[0] + (yy * y + yz * z), after[1] + (zy * y + zz * z)


def along_line(lowpass: Filter, x: State, begin: Real, end: Real) -> State:
    """The state at the end, where the rate goes from `begin` to `end` in a straight line, rad/s."""
    slope = (end - begin) / lowpass.time
    lag = slope / lowpass.sigma
    return _about(lowpass, x, (begin - lag, slope), (end - lag, slope))


def along_decay(lowpass: Filter, x: State, begin: Real, final: Real, decay: Real) -> State:
    """The state at the end, where the rate goes from `begin` towards `final` (rad/s) with the rate constant `decay`
    (1/s)."""
    gain = (
        2.0
        * lowpass.sigma
        * lowpass.sigma
        / (decay * decay - 2.0 * lowpass.sigma * decay + 2.0 * lowpass.sigma * lowpass.sigma)
    )
    away = gain * (begin - final)
    left = away * exp(-decay * lowpass.time)
    return _about(lowpass, x, (final + away, -decay * away), (final + left, -decay * left))
