"""The declaration of a sensor: it reads a quantity, of a joint or of a link; and the steps of a number into a computer.

A sensor of a joint stands in a servo, between a quantity and the control law that sees it, and reads at the servo's
ticks. A sensor of a link (`measures`) stands in a run under a name of its own, and reads at ticks of its own.

A sensor is split where the real one is. Its circuit (`follow`, over `State`) is integrated with the arm; the computer's
part (`read`, over `Memory`) runs at ticks. All are ordinary functions over numbers that may be traced (docs/models.md).
Units: `of` is that of the quantity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from typing import Any, Protocol

from met.environments.environment import World
from met.frozen import frozen
from met.parameter import BASE, Declaration, Memory, Parameter, State
from met.sensors import butterworth
from met.trace import Real, rint, sqrt, where
from met.vectors import ZERO, Vector, dot, scale


class Felt(World, Protocol):
    """The view of the arm that a sensor of a link has: the methods of a `World`, and quantities that only show on
    board. Links are those of a World, and `base`, whether it moves or not.

    Accelerations follow from a derivative: a circuit may ask for them, a reading at a tick may not, since what acts
    from the tick on is not yet known.
    """

    def acceleration(self, link: str, point: Vector = ZERO) -> Vector:
        """Second derivative of the world position of a point given in the link's frame, m: world axes, m/s^2."""

    def specific_force(self, link: str, point: Vector = ZERO) -> Vector:
        """Acceleration of a point of the link less that of free fall there, which an accelerometer feels: link axes,
        m/s^2."""

    def spin(self, link: str) -> Vector:
        """Angular velocity against directions that do not turn: link axes, rad/s."""


@frozen
class Sensed:
    """The inputs of a sensor at a tick.

    find    gives the quantity itself
    period  time from this tick to the next, s
    draw    a normal deviate of this tick, mean 0 and variance 1: the same each time it is asked for
    """

    find: Callable[[], Real]
    period: float
    draw: Callable[[], Real]

    @property
    def value(self) -> Real:
        """The quantity itself; for a link's sensor only where it is not an acceleration."""
        return self.find()


@frozen
class Reading:
    """The answer of a sensor at a tick: the number read, and its new memory, by name."""

    value: Real
    held: Mapping[str, Real] = field(default_factory=dict)


@frozen(kw_only=True)
class Sensor(Declaration):
    """The declaration of a sensor; one a file.

    measures (p, felt) -> the quantity, of a link's sensor; felt is a `Felt`. None: it is a joint's, in a servo
    unit     of what it measures: the unit word `of`. "": of the quantity of the servo that it is put on
    fastest  (p) -> rate constant of its circuit, 1/s: with the step it says whether that is stable. None: unknown, or
             there is none
    swing    (p) -> a and b of its circuit's y'' = -a y - b y' (1/s^2, 1/s), of one that swings. None: it does not
    follow   (p, states, value) -> slopes of its states, by name. None: it has none
    begin    (p, value) -> states and memory where a run begins, by name, the quantity having been at this value
    read     (p, held, states, sensed) -> Reading
    clocked  whether it reads at ticks alone, as what has noise, steps or a delay does: no continuous law can see it
    """

    states: tuple[State, ...] = ()
    memory: tuple[Memory, ...] = ()
    follow: Callable[[Any, Any, Real], Mapping[str, Real]] | None = None
    begin: Callable[[Any, Real], Mapping[str, Real]]
    read: Callable[[Any, Any, Any, Sensed], Reading]
    clocked: bool = True
    measures: Callable[[Any, Any], Real] | None = None
    unit: str = ""
    fastest: Callable[[Any], Real | None] | None = None
    swing: Callable[[Any], tuple[Real, Real] | None] | None = None

    @property
    def written(self) -> tuple[Parameter, ...]:
        """The parameters as a deck writes them; those of a link's sensor in its own unit."""
        return tuple(replace(p, unit=self.unit) if self.unit and p.unit == "of" else p for p in self.parameters)


MOST = 3
"""Largest delay in ticks."""

NOISE = Parameter(name="noise", unit="of", default=0.0, at_least=0.0, doc="white noise that is added at each tick, rms")
RESOLUTION = Parameter(
    name="resolution",
    unit="of",
    default=0.0,
    at_least=0.0,
    doc="step of the converter, which rounds to the nearest one; 0: no rounding",
)
DELAY = Parameter(
    name="delay",
    default=0.0,
    at_least=0.0,
    at_most=float(MOST),
    whole=True,
    doc="ticks by which the reading is late",
)
PAST = tuple(Memory(name=f"past_{n}", unit="of", doc=f"reading {n} ticks before the last") for n in range(MOST))


def noisy(p: Any, value: Real, sensed: Sensed) -> Real:
    """The value with the noise of this tick."""
    return value + where(p.noise > 0.0, p.noise * sensed.draw(), 0.0)


def converted(x: Real, resolution: Real) -> Real:
    """The value rounded to the nearest of a converter's steps; unchanged where the resolution is 0."""
    step = where(resolution > 0.0, resolution, 1.0)
    return where(resolution > 0.0, step * rint(x / step), x)


def delayed(p: Any, held: Any, value: Real) -> Reading:
    """The reading of `delay` ticks ago, and the queue one tick on."""
    queue = [value, *(getattr(held, memory.name) for memory in PAST)]
    seen = value
    for ago in range(1, MOST + 1):
        seen = where(p.delay == float(ago), queue[ago], seen)
    return Reading(seen, {memory.name: queue[n] for n, memory in enumerate(PAST)})


def filled(value: Real) -> Mapping[str, Real]:
    """The queue at the start of a run."""
    return {memory.name: value for memory in PAST}


LINK = Parameter(name="link", shape="word", names="link", words=(BASE,), doc="link that the sensor is fixed to")
ALONG = Parameter(
    name="along",
    shape="vector",
    direction=True,
    doc="measured direction, in the link's frame; the length of the vector does not matter",
)
SCALE = Parameter(
    name="scale",
    default=1.0,
    doc="reading per unit of the measured quantity: with 1.01 the sensor reads one per cent more",
)
BIAS = Parameter(name="bias", unit="of", default=0.0, doc="reading at zero of the measured quantity")


def component(along: Vector, vector: Vector) -> Real:
    """The component of a vector along a direction of any length."""
    return dot(scale(1.0 / sqrt(dot(along, along)), along), vector)


def reading(p: Any, held: Any, value: Real, sensed: Sensed) -> Reading:
    """A value with scale, bias and the tick's noise, to the nearest step of the converter, `delay` ticks late."""
    return delayed(p, held, converted(noisy(p, p.scale * value + p.bias, sensed), p.resolution))


def at_rest(p: Any, value: Real) -> Real:
    """The reading at the start of a run, without noise."""
    return converted(p.scale * value + p.bias, p.resolution)


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
