"""A sensor's analog filter of order 2: y'' = w^2 (x - y) - sqrt(2) w y', w = 2 pi cutoff; integrated with the arm."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.parameter import Only, Parameter, State
from met.trace import Real


def cutoff(only: Only | None = None) -> Parameter:
    """The filter's parameter."""
    return Parameter(name="cutoff", unit="Hz", above=0.0, only=only, doc="cut-off frequency of the filter")


def states(only: Only | None = None) -> tuple[State, ...]:
    """The filter's states: its output, and the slope of that."""
    return (
        State(name="filtered", unit="of", only=only, doc="output of the filter"),
        State(name="filtered_slope", unit="of/s", only=only, doc="rate of change of the filter's output"),
    )


def slopes(p: Any, states: Any, value: Real) -> Mapping[str, Real]:
    """Slopes of the filter's states, with this value at its input."""
    w = 2.0 * math.pi * p.cutoff
    bend = w * w * (value - states.filtered) - math.sqrt(2.0) * w * states.filtered_slope
    return {"filtered": states.filtered_slope, "filtered_slope": bend}


def fastest(p: Any) -> Real:
    """The size of the filter's poles, 1/s."""
    rate: Real = 2.0 * math.pi * p.cutoff
    return rate


def swing(p: Any) -> tuple[Real, Real]:
    """The a and b of the filter's y'' = -a y - b y'."""
    w = fastest(p)
    return w * w, math.sqrt(2.0) * w


def settled(value: Real) -> Mapping[str, Real]:
    """The filter's states after a long constant input."""
    return {"filtered": value, "filtered_slope": 0.0}
