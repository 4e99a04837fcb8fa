"""The firing times of a thruster: a window, pulses in it, and a list of switching times; it fires where all of them
allow it.

What a step of the dynamics sees is constant in it: the share of the step in which the thruster fires.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

from met.environments.environment import WINDOW, World, never, passed
from met.parameter import Parameter
from met.trace import Real, floor, maximum, minimum, where

FIRING = (
    *WINDOW,
    Parameter(
        name="period",
        unit="s",
        default=1.0,
        above=0.0,
        doc="time from one pulse to the next; the first pulse starts at `from`",
    ),
    Parameter(
        name="duty",
        default=1.0,
        above=0.0,
        at_most=1.0,
        doc="share of the period for which a pulse lasts, from the start of the period; 1: the thruster fires "
        "without pulses",
    ),
    Parameter(
        name="switches",
        unit="s",
        shape="list",
        rises=True,
        default=(),
        doc="times at which the thruster is switched on, off, on and so on; without them it is on from the start",
    ),
)


def share(p: Any, world: World) -> Real:
    """The share of the step in which the thruster fires."""
    begins = getattr(p, "from")
    total: Real = 0.0
    for on, off in _intervals(p.switches):
        opened = passed(world, begins if on == -math.inf else maximum(on, begins))
        shut = maximum(opened, passed(world, minimum(off, p.until)))
        within = world.begin + opened * world.step - begins  # time since the first pulse began
        phase = within - floor(within / p.period) * p.period
        pulses = _fired(p, phase + (shut - opened) * world.step) - _fired(p, phase)
        total = total + where(p.duty >= 1.0, shut - opened, pulses / world.step)
    return total


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why the thruster never fires in a run of this length, with the parameters that say so."""
    begins = getattr(p, "from")
    if not any(max(on, begins, 0.0) < min(off, p.until, duration) for on, off in _intervals(p.switches)):
        return never(begins, p.until, duration) or (("switches",), "it is never on while the run lasts")
    return None


def _intervals(switches: tuple[float, ...]) -> list[tuple[float, float]]:
    """Pairs of switch-on and switch-off times, s; the last has no end where it is not switched off again."""
    if not switches:
        return [(-math.inf, math.inf)]
    return list(itertools.zip_longest(switches[::2], switches[1::2], fillvalue=math.inf))


def _fired(p: Any, time: Real) -> Real:
    """The total time that the thruster has fired, this time after a pulse began."""
    whole = floor(time / p.period)
    return whole * (p.duty * p.period) + minimum(time - whole * p.period, p.duty * p.period)
