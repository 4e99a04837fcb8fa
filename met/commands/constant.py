"""The same value at all times. `rate(slow)` is short for `rate(constant(value = slow))`."""

from __future__ import annotations

from typing import Any

from met.commands.profile import Profile
from met.parameter import Parameter
from met.trace import Real


def course(p: Any, t: Real) -> tuple[Real, Real]:
    return p.value, 0.0


PROFILE = Profile(
    name="constant",
    doc=__doc__,
    parameters=(Parameter(name="value", unit="command", doc="value of the command at all times"),),
    course=course,
    jumps="none",
)
