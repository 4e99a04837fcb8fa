"""The filter of a sensor that may have one: `filter = butterworth`, or `none`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter
from met.sensors import butterworth
from met.sensors.sensor import Sensed
from met.trace import Real

_THERE = ("filter", ("butterworth",))

FILTER = Parameter(
    name="filter",
    shape="word",
    words=("none", "butterworth"),
    default="none",
    doc="analog filter between the quantity and the reading",
)
CUTOFF = butterworth.cutoff(_THERE)
STATES = butterworth.states(_THERE)


def follow(p: Any, states: Any, value: Real) -> Mapping[str, Real]:
    return {} if p.filter == "none" else butterworth.slopes(p, states, value)


def fastest(p: Any) -> Real | None:
    return None if p.filter == "none" else butterworth.fastest(p)


def swing(p: Any) -> tuple[Real, Real] | None:
    return None if p.filter == "none" else butterworth.swing(p)


def settled(p: Any, value: Real) -> Mapping[str, Real]:
    """The filter's states after a long constant input."""
    return {} if p.filter == "none" else butterworth.settled(value)


def behind(p: Any, states: Any, sensed: Sensed) -> Real:
    """The filter's output at a tick; without a filter, its input."""
    output: Real = sensed.value if p.filter == "none" else states.filtered
    return output
