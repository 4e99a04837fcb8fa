"""From one held value to another in the least time that a rate limit and an acceleration limit allow.

The rate is a trapezoid in time: it rises with `max_acceleration`, stays at `max_rate` and falls again; for a short way
it is a triangle, whose peak is sqrt(max_acceleration * way). So the value and its rate are continuous: a parabola, a
line, a parabola. It is made for position commands; for another command it limits the first and second derivative in the
same way.

It is not a limiter: it knows neither the state of the joint nor the limits of the servo. The acceleration jumps at the
corners.
"""

from __future__ import annotations

import math
from typing import Any

from met.commands.profile import Profile
from met.content import NEVER, Content
from met.parameter import Parameter
from met.trace import Real, absolute, clip, maximum, minimum, sqrt, where


def course(p: Any, t: Real) -> tuple[Real, Real]:
    """The commanded value and its rate at time `t`, s."""
    way = absolute(p.to - p.start)
    towards = where(p.to < p.start, -1.0, 1.0)
    peak = minimum(p.max_rate, sqrt(p.max_acceleration * way))
    rise = peak / p.max_acceleration
    # without a way there is no peak: `where` computes the quotient all the same
    level = maximum((way - peak * rise) / where(peak > 0.0, peak, 1.0), 0.0)
    whole = 2.0 * rise + level
    done = clip(t - p.begin, 0.0, whole)
    left = whole - done
    # counted from the nearer end, so that both ends are met exactly
    rising = p.start + towards * (0.5 * p.max_acceleration * done * done)
    even = p.start + towards * (peak * (done - 0.5 * rise))
    falling = p.to - towards * (0.5 * p.max_acceleration * left * left)
    value = where(left < rise, falling, where(done < rise, rising, even))
    slope = towards * minimum(peak, p.max_acceleration * minimum(done, left))
    return where(done < whole, value, p.to), slope


def content(p: Any, duration: float) -> Content:
    """The demands of the move on the sampling in time: when it begins and ends, s."""
    way = abs(p.to - p.start)
    if way == 0.0:
        return NEVER
    peak = min(p.max_rate, math.sqrt(p.max_acceleration * way))
    # a move that is too slow for any number has no end
    return Content(begins=p.begin, ends=p.begin + peak / p.max_acceleration + way / peak if peak > 0.0 else math.inf)


PROFILE = Profile(
    name="trapezoid",
    doc=__doc__,
    of_a_rate="the joint goes on at the rate `to`: to move and stop it write `rate(pulse(to = ..., slope = ..., "
    "over = ...))`, or `position(trapezoid(...))`",
    parameters=(
        Parameter(name="start", unit="command", default=0.0, doc="value before the move"),
        Parameter(name="to", unit="command", doc="value after the move"),
        Parameter(name="max_rate", unit="command/s", above=0.0, doc="largest rate"),
        Parameter(
            name="max_acceleration",
            unit="command/s^2",
            above=0.0,
            doc="acceleration at the start, and deceleration at the end",
        ),
        Parameter(name="begin", unit="s", default=0.0, at_least=0.0, doc="time at which the move begins"),
    ),
    course=course,
    content=content,
    jumps="none",
)
