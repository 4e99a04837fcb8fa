"""From a held value to another, which is held, and back again, with the same slope up and down; `over` is the whole
time.

It is made for rate commands, whose slope is an acceleration: the joint speeds up, moves on at `to` and slows down. The
value is a trapezoid in time; with the shortest `over`, 2 |to - start|/slope, it is a triangle, and a shorter one is an
error. From zero and back, the integral, which is the way of the joint, is to (over - |to|/slope).

It is not a limiter: it knows neither the state of the joint nor the limits of the servo. The slope jumps at the
corners.
"""

from __future__ import annotations

from typing import Any

from met.commands.profile import Profile
from met.content import NEVER, Content, content_of_points
from met.parameter import Parameter
from met.trace import Real, absolute, both, clip, maximum, minimum, where


def course(p: Any, t: Real) -> tuple[Real, Real]:
    """The commanded value and its rate at time `t`, s."""
    rise = absolute(p.to - p.start) / p.slope
    done = clip(t - p.begin, 0.0, p.over)
    left = p.over - done
    near = minimum(done, left)  # counted from the nearer end, so that both ends are met exactly
    towards = where(p.to < p.start, -1.0, 1.0) * p.slope
    low, high = minimum(p.start, p.to), maximum(p.start, p.to)
    sloping = clip(p.start + towards * near, low, high)
    value = where(near >= rise, p.to, sloping)
    moving = both(both(t >= p.begin, left > 0.0), where(done < left, near < rise, near <= rise))
    return value, where(moving, where(done < left, towards, -towards), 0.0)


def shortest(p: Any) -> Real:
    """The shortest `over`, s: the time for the ways up and down."""
    return 2.0 * absolute(p.to - p.start) / p.slope


def content(p: Any, duration: float) -> Content:
    """The demands of the pulse on the sampling in time: its corners."""
    if p.to == p.start:
        return NEVER
    rise = min(abs(p.to - p.start) / p.slope, 0.5 * p.over)
    corners = ((0.0, p.start), (rise, p.to), (p.over - rise, p.to), (p.over, p.start))
    times, values = zip(*(dict(corners)).items(), strict=True)
    return content_of_points(times, values, p.begin)


PROFILE = Profile(
    name="pulse",
    doc=__doc__,
    parameters=(
        Parameter(name="start", unit="command", default=0.0, doc="value before and after the pulse"),
        Parameter(name="to", unit="command", doc="value that is held during the pulse"),
        Parameter(
            name="slope",
            unit="command/s",
            above=0.0,
            doc="rate of change at the beginning and the end of the pulse; an acceleration for a rate command",
        ),
        Parameter(name="over", unit="s", above=0.0, doc="duration of the whole pulse, with its rise and its fall"),
        Parameter(name="begin", unit="s", default=0.0, at_least=0.0, doc="time at which the pulse begins"),
    ),
    course=course,
    content=content,
    shortest=shortest,
)
