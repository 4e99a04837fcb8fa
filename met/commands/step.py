"""A jump from one value to another: `start` before the time `at`, `to` from then on."""

from __future__ import annotations

from typing import Any

from met.commands.profile import Profile
from met.content import NEVER, Content
from met.instants import has_come
from met.parameter import Parameter
from met.trace import Real, where


def course(p: Any, t: Real) -> tuple[Real, Real]:
    return where(has_come(t, p.at), p.to, p.start), 0.0


def content(p: Any, duration: float) -> Content:
    return Content(begins=p.at, ends=p.at) if p.to != p.start else NEVER


PROFILE = Profile(
    name="step",
    doc=__doc__,
    parameters=(
        Parameter(name="start", unit="command", default=0.0, doc="value before the jump"),
        Parameter(name="to", unit="command", doc="value after the jump"),
        Parameter(name="at", unit="s", default=0.0, at_least=0.0, doc="time of the jump"),
    ),
    course=course,
    content=content,
    jumps="value",
)
