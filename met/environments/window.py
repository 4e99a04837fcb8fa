"""A window in time, as the steps of the dynamics see it: the share of each step that lies in it, constant in the step.

A load that jumped within a step would cost an integrator its order. Multiplied by the share, the load has the right
impulse, and a window that begins and ends with steps is met exactly.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

from met.instants import has_come
from met.parameter import Parameter
from met.trace import Real, Truth, both, clip, maximum, not_, where


class Step(Protocol):
    """A step of the dynamics: the time at which it began, and its length, s."""

    begin: Real
    step: float


WINDOW = (
    Parameter(name="from", unit="s", default=0.0, doc="time at which the effect begins"),
    Parameter(name="until", unit="s", default=math.inf, doc="time at which the effect ends; by default never"),
)


def share(world: Step, begins: Real, ends: Real) -> Real:
    """The share of the step that lies in begins <= t < ends; 0 where `ends` is the earlier."""
    return maximum(0.0, passed(world, ends) - passed(world, begins))


def passed(world: Step, time: Real) -> Real:
    """The share of the step that lies before this time."""
    before = clip((time - world.begin) / world.step, 0.0, 1.0)
    whole = has_come(time, world.begin + world.step)  # to rounding, as in the case of no share
    return where(has_come(world.begin, time), 0.0, where(whole, 1.0, before))


def open_at(p: Any, now: Real) -> Truth:
    """True where an instant lies in the window of a model that declares one: from <= now < until."""
    return both(has_come(now, getattr(p, "from")), not_(has_come(now, p.until)))


def never(begins: float, until: float, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why a window of constants contains no part of a run of this length, with the parameters that say
    so."""
    if begins >= until:
        return ("until", "from"), f"it would begin at {begins:g} s and end at {until:g} s"
    if begins >= duration:
        return ("from",), f"it would begin at {begins:g} s, and the run ends at {duration:g} s"
    if until <= 0.0:
        return ("until",), f"it would end at {until:g} s, and the run begins at 0 s"
    return None
