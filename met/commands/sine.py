"""A sine about an offset: offset + amplitude sin(2 pi frequency t + phase), from t = 0."""

from __future__ import annotations

import math
from typing import Any

from met.commands.profile import Profile
from met.content import NEVER, Content
from met.parameter import Parameter
from met.trace import Real, cos, sin


def course(p: Any, t: Real) -> tuple[Real, Real]:
    omega = 2.0 * math.pi * p.frequency
    angle = omega * t + p.phase
    return p.offset + p.amplitude * sin(angle), p.amplitude * omega * cos(angle)


def content(p: Any, duration: float) -> Content:
    return Content(begins=0.0, ends=math.inf, frequency=p.frequency) if p.amplitude != 0.0 else NEVER


PROFILE = Profile(
    name="sine",
    doc=__doc__,
    parameters=(
        Parameter(name="amplitude", unit="command", doc="amplitude: half of the distance from trough to crest"),
        Parameter(name="frequency", unit="Hz", above=0.0, doc="frequency, in cycles per second"),
        Parameter(name="offset", unit="command", default=0.0, doc="value about which the command oscillates"),
        Parameter(name="phase", unit="rad", default=0.0, doc="phase angle at t = 0"),
    ),
    course=course,
    content=content,
    jumps="none",
)
