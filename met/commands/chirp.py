"""A sine about an offset whose frequency changes from `f0` to `f1` in the time `over`.

    value = offset + amplitude sin(2 pi turns(t - begin) + phase), turns the integral of the frequency f
    linear        f = f0 + (f1 - f0) s/over         as many hertz in each second
    exponential   f = f0 (f1/f0)^(s/over)           as many octaves in each second

Before `begin` the first value is held, and after `over` the last one, whatever it is, with slope zero. The amplitude of
the slope grows with the frequency.
"""

from __future__ import annotations

import math
from typing import Any

from met.commands.profile import Profile
from met.content import NEVER, Content
from met.parameter import Parameter
from met.trace import Real, absolute, both, clip, cos, exp, log, sin, tanh, where


def course(p: Any, t: Real) -> tuple[Real, Real]:
    """The commanded value and its rate at time `t`, s."""
    s = clip(t - p.begin, 0.0, p.over)
    if p.growth == "linear":
        gain = (p.f1 - p.f0) / p.over
        frequency = p.f0 + gain * s
        turns = s * (p.f0 + 0.5 * gain * s)
    else:
        x = log(p.f1 / p.f0) * (s / p.over)
        frequency = p.f0 * exp(x)
        turns = p.f0 * s * _mean_of_exp(x)
    angle = 2.0 * math.pi * turns + p.phase
    slope = p.amplitude * (2.0 * math.pi * frequency) * cos(angle)
    moving = both(t >= p.begin, t < p.begin + p.over)
    return p.offset + p.amplitude * sin(angle), where(moving, slope, 0.0)


def _mean_of_exp(x: Real) -> Real:
    """(e^x - 1)/x, 1 at x = 0: the mean of e^y for y from 0 to x, right to some units in its last place.

    Near 0 by e^x - 1 = 2 h/(1 - h) with h = tanh(x/2), which subtracts no like numbers.
    """
    small = absolute(x) < 1.0
    h = tanh(0.5 * where(small, x, 1.0))
    divisor = where(x == 0.0, 1.0, x)
    near = where(x == 0.0, 1.0, 2.0 * h / ((1.0 - h) * divisor))
    return where(small, near, (exp(x) - 1.0) / divisor)


def content(p: Any, duration: float) -> Content:
    """The demands of the chirp on the sampling in time: its fastest swing is at one of its ends, or where the run ends
    before."""
    if p.amplitude == 0.0:
        return NEVER
    done = min(max(duration - p.begin, 0.0) / p.over, 1.0)
    last = p.f0 + (p.f1 - p.f0) * done if p.growth == "linear" else p.f0 * (p.f1 / p.f0) ** done
    return Content(begins=p.begin, ends=p.begin + p.over, frequency=max(p.f0, last))


PROFILE = Profile(
    name="chirp",
    doc=__doc__,
    parameters=(
        Parameter(name="amplitude", unit="command", doc="amplitude: half of the distance from trough to crest"),
        Parameter(name="f0", unit="Hz", above=0.0, doc="frequency at the start, in cycles per second"),
        Parameter(name="f1", unit="Hz", above=0.0, doc="frequency at the end, in cycles per second"),
        Parameter(name="over", unit="s", above=0.0, doc="time during which the frequency changes"),
        Parameter(
            name="growth",
            shape="word",
            words=("linear", "exponential"),
            default="linear",
            doc="change of the frequency: by equal steps (`linear`) or by equal ratios (`exponential`) in equal times",
        ),
        Parameter(name="offset", unit="command", default=0.0, doc="value about which the command oscillates"),
        Parameter(name="phase", unit="rad", default=0.0, doc="phase angle at the start"),
        Parameter(name="begin", unit="s", default=0.0, at_least=0.0, doc="time at which the oscillation begins"),
    ),
    course=course,
    content=content,
)
