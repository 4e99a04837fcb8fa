"""A straight line in time between two held values: `start` until `begin`, and `to` from a time `over` later."""

from __future__ import annotations

from typing import Any

from met.commands.profile import Profile
from met.content import NEVER, Content
from met.parameter import Parameter
from met.trace import Real, both, clip, where


def course(p: Any, t: Real) -> tuple[Real, Real]:
    """The commanded value and its rate at time `t`, s."""
    slope = (p.to - p.start) / p.over
    share = clip((t - p.begin) / p.over, 0.0, 1.0)
    moving = both(t >= p.begin, t < p.begin + p.over)
    return p.start + (p.to - p.start) * share, where(moving, slope, 0.0)


def content(p: Any, duration: float) -> Content:
    return Content(begins=p.begin, ends=p.begin + p.over) if p.to != p.start else NEVER


PROFILE = Profile(
    name="ramp",
    doc=__doc__,
    parameters=(
        Parameter(name="start", unit="command", default=0.0, doc="value before the ramp"),
        Parameter(name="to", unit="command", doc="value after the ramp"),
        Parameter(name="begin", unit="s", default=0.0, at_least=0.0, doc="time at which the ramp begins"),
        Parameter(name="over", unit="s", above=0.0, doc="duration of the ramp"),
    ),
    course=course,
    content=content,
)
