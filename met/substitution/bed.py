"""The declaration of a bed: a motor and its load on one shaft, a wire to it, and what is read back.

The wire carries the drive motor's voltage and the load motor's current, held by the amplifiers from one tick to the
next, and brings back the filtered rate of the shaft, once a tick. An emulated bed is a model, below; a real one takes
its place at the wire.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any

from met.frozen import frozen
from met.parameter import Memory, Parameter
from met.trace import Real, Truth


@frozen
class Wire:
    """The values that the amplifiers hold: voltage of the drive motor, V; current of the load motor, A."""

    voltage: Real
    current: Real


Draw = Callable[[str], Real]
"""A normal deviate of mean 0 and variance 1 by the name of what is noisy: one a tick, the same however it is run."""


@frozen(kw_only=True)
class Bed:
    """The declaration of an emulated bed; one a file.

    memory    its state, recorded under its names; `shaft_rate` (rad/s) is among them
    begin     (p, w) -> the memory of a shaft that has turned at w rad/s for long
    advance   (p, held, wire, time, draw) -> the memory after `time` s, by name
    read      (p, held) -> the filtered rate as the computer reads it, rad/s
    taken     (p, wire) -> what the amplifiers make of a command, converters and limits; whether a limit held it back
    presets   by the word `faults`: what parameters are that a deck does not write
    """

    name: str
    doc: str
    parameters: tuple[Parameter, ...] = ()
    memory: tuple[Memory, ...]
    begin: Callable[[Any, Real], Mapping[str, Real]]
    advance: Callable[[Any, Any, Wire, float, Draw], Mapping[str, Real]]
    read: Callable[[Any, Any], Real]
    taken: Callable[[Any, Wire], tuple[Wire, Truth]]
    presets: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
