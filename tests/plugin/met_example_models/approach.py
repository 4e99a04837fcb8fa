"""An exponential approach from zero: to (1 - exp(-t/time))."""

from __future__ import annotations

from typing import Any

from met.commands import Profile
from met.parameter import Parameter
from met.trace import Real, exp


def course(p: Any, t: Real) -> tuple[Real, Real]:
    left = exp(-t / p.time)
    return p.to * (1.0 - left), p.to / p.time * left


PROFILE = Profile(
    name="approach",
    doc=__doc__,
    parameters=(
        Parameter(name="to", unit="command", doc="value that is approached"),
        Parameter(name="time", unit="s", above=0.0, doc="time constant"),
    ),
    course=course,
)
