"""Straight lines through points in time; the value is held before the first point and after the last."""

from __future__ import annotations

from typing import Any

from met.commands.points import ends, linear
from met.commands.profile import Profile
from met.content import Content, content_of_points
from met.parameter import Parameter
from met.trace import Real


def course(p: Any, t: Real) -> tuple[Real, Real]:
    if len(p.times) == 1:
        return p.values[0], 0.0
    return linear(p.times, p.values, t)


def content(p: Any, duration: float) -> Content:
    return content_of_points(p.times, p.values)


PROFILE = Profile(
    name="table",
    doc=__doc__,
    parameters=(
        Parameter(name="times", unit="s", shape="list", rises=True, doc="times of the points, in ascending order"),
        Parameter(
            name="values", unit="command", shape="list", as_many_as="times", doc="values at `times`, one for each"
        ),
    ),
    course=course,
    content=content,
    limits=(ends(lambda p, t: t),),
)
