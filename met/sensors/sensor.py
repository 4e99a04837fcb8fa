"""What a sensor is to the engine: it stands between a quantity of a joint and the control law that sees it.

A sensor is split where the real one is. Its circuit (`follow`, over `State`) is integrated with the arm; what its
computer makes of that (`read`, over `Memory`) happens at the servo's ticks. Both are ordinary functions over numbers
that may be traced (docs/models.md). Units: `of` is that of the quantity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any

from met.frozen import frozen
from met.parameter import Memory, Parameter, State
from met.trace import Real


@frozen
class Sensed:
    """What there is to read at a tick.

    value   the quantity itself
    period  time from this tick to the next, s
    draw    a normal deviate of this tick, mean 0 and variance 1: the same each time it is asked for
    """

    value: Real
    period: float
    draw: Callable[[], Real]


@frozen
class Reading:
    """What a sensor gives at a tick: the number that the law sees, and its new memory, by name."""

    value: Real
    held: Mapping[str, Real] = field(default_factory=dict)


@frozen(kw_only=True)
class Sensor:
    """The declaration of a sensor; one a file.

    follow   (p, states, value) -> slopes of its states, by name. None: it has none
    begin    (p, value) -> states and memory where a run begins, by name, the quantity having been at this value
    read     (p, held, states, sensed) -> Reading
    clocked  whether it reads at ticks alone, as what has noise, steps or a delay does: no continuous law can see it
    """

    name: str
    doc: str
    parameters: tuple[Parameter, ...] = ()
    states: tuple[State, ...] = ()
    memory: tuple[Memory, ...] = ()
    follow: Callable[[Any, Any, Real], Mapping[str, Real]] | None = None
    begin: Callable[[Any, Real], Mapping[str, Real]]
    read: Callable[[Any, Any, Any, Sensed], Reading]
    clocked: bool = True
