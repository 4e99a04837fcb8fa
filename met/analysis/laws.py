"""Laws of servos linearised, with the sensors through which they see: differences of the functions that run.

A law is a function of its inputs and of its memory, and a sensor is one of the quantity, of its circuit's states and of
its memory. Their slopes are combined here into the derivative of a law's outputs, integrals and sensors' memory after a
tick, by the arm's state and by all memory. No particular model is assumed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from met.analysis.lanes import SMALL, SMALL_STATE, ZERO, LaneTape, differences, spread_over, to_both_sides
from met.frozen import frozen
from met.parameter import Parameter
from met.program.build import Builder
from met.program.cells import NamedValues, answer
from met.program.control import sensing
from met.program.evaluation import law
from met.program.system import Actuator, Fitted
from met.sensors.sensor import Reading, Sensed
from met.servos.servo import JointMotion, Parts, Seen, Setpoint

READINGS = 10.0 ** np.arange(-6, 3)
"""Changes of a sensor's quantity over which its slope is taken, in its unit: a converter has steps, and a range
ends."""


@frozen
class SampledLaw:
    """The linearised law of a servo with its sensors: what a tick makes of state and memory.

    memory      its cells: outputs, then integrals, then memory of its sensors
    outputs     how many of them are outputs;  integrals: are integrals
    divisor     ticks of the base rate from one to the next
    continuous  whether it has no ticks, and this is its slope in the steps of the dynamics
    command     the kind of its command
    slope       [lane, memory, state and all servos' memory];  direct: the same where the law sees what is so
    """

    joint: str
    divisor: int
    continuous: bool
    command: str
    memory: tuple[str, ...]
    outputs: int
    integrals: int
    slope: np.ndarray
    direct: np.ndarray


def memory(actuator: Actuator) -> tuple[str, ...]:
    """The cells of a law's memory and of its sensors' memory."""
    own = [f"{actuator.path}.{name}" for name in _held(actuator.parts)]
    return (*own, *(f"{sensor.path}.{part.name}" for sensor in actuator.sensors for part in sensor.memory))


def linearised(
    builder: Builder,
    actuator: Actuator,
    tape: LaneTape,
    cells: Sequence[str],
    *,
    continuous: bool,
    scaled: Mapping[str, float] | None = None,
) -> SampledLaw:
    """A law's slopes on a tape, under a command that keeps its joint as it is.

    cells   the state, then all servos' memory
    scaled  what parameters of the servo are multiplied by, by name
    """
    linear_law, parts, joint = _Linearised(builder, actuator, tape, cells), actuator.parts, actuator.use.joint
    true = linear_law.quantities()
    seen, of_sensors = linear_law.through_sensors(true)
    of_law = linear_law.law(scaled or {})
    own = np.zeros((tape.lanes, len(parts.outputs) + len(parts.integrals), len(cells)))
    for place, name in enumerate(_held(parts), len(true)):
        own[:, :, linear_law.place(f"{actuator.path}.{name}")] += of_law[:, :, place]
    by_quantity = of_law[:, :, : len(true)]
    none = np.zeros((tape.lanes, 0, len(cells)))
    return SampledLaw(
        joint,
        actuator.use.divisor,
        continuous,
        actuator.command_kind,
        memory(actuator),
        len(parts.outputs),
        len(parts.integrals),
        np.concatenate([own + by_quantity @ np.stack(list(seen.values()), 1), of_sensors], axis=1),
        np.concatenate([own + by_quantity @ np.stack(list(true.values()), 1), 0.0 * of_sensors], axis=1)
        if actuator.sensors
        else none,
    )


def gains(builder: Builder, actuator: Actuator, tape: LaneTape) -> Iterator[Parameter]:
    """The parameters of a servo on which its law's slopes depend, but the physics under its outputs does not."""
    linear_law = _Linearised(builder, actuator, tape, ())
    law_now, drive_now = linear_law.law({}), linear_law.drive({})
    for parameter in actuator.parts.parameters:
        if parameter.shape == "number" and parameter.at_least == 0.0:
            scaled = {parameter.name: 0.5}
            if not np.array_equal(linear_law.law(scaled), law_now) and linear_law.drive(scaled) == drive_now:
                yield parameter


class _Linearised:
    """A law over the lanes of a tape: a quantity's slope is [lane, cell]."""

    def __init__(self, builder: Builder, actuator: Actuator, tape: LaneTape, cells: Sequence[str]) -> None:
        self.builder, self.system, self.actuator, self.tape = builder, builder.system, actuator, tape
        self.cells, self._places = cells, {name: place for place, name in enumerate(cells)}

    def place(self, cell: str) -> int:
        return self._places[cell]

    def quantities(self) -> dict[str, np.ndarray]:
        """The slopes of the law's true inputs: `q`, `qd` and states of the servo, by name."""
        joint, path, tape = self.actuator.use.joint, self.actuator.path, self.tape
        natural = [state.name for state in self.actuator.parts.natural]
        cells = [f"{joint}.q", f"{joint}.qd", *(f"{path}.{name}" for name in natural)]
        by_quantity = {name: np.zeros((tape.lanes, len(self.cells))) for name in ("q", "qd", *natural)}
        for name, cell in zip(by_quantity, cells, strict=True):
            by_quantity[name][:, self.place(cell)] = 1.0
        if self.actuator.servo.measured is not None:
            start = np.array([tape.lane(cell) for cell in cells])
            moved, sizes = to_both_sides(start, _sizes(start, 2))
            states: Any = NamedValues(self.actuator.owner, dict(zip(natural, moved[2:], strict=True)))
            p, (q, qd) = self._values(2 * len(cells), {}), moved[:2]
            of_joint = sensing.measured(self.actuator, p, q, qd, states)
            slopes = differences(dict(zip(("q", "qd"), of_joint, strict=True)), ("q", "qd"), sizes)
            for column, name in enumerate(("q", "qd")):
                by_quantity[name][:] = 0.0
                by_quantity[name][:, [self.place(cell) for cell in cells]] = slopes[:, column]
        return by_quantity

    def through_sensors(self, true: Mapping[str, np.ndarray]) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """The slopes of the law's inputs as its sensors give them, and of the sensors' memory after a tick, [lane,
        memory, cell]."""
        seen, held = dict(true), [np.zeros((self.tape.lanes, 0, len(self.cells)))]
        for fitted in self.actuator.sensors:
            quantity = sensing.quantity(fitted)
            slopes = self._reading(fitted)
            names = [*(state.name for state in fitted.states), *(memory.name for memory in fitted.memory)]
            inner = [self.place(f"{fitted.path}.{name}") for name in names]
            rows = slopes[:, :, :1] * true[quantity][:, None, :]
            rows[:, :, inner] += slopes[:, :, 1:]
            seen[quantity] = rows[:, 0]
            held.append(rows[:, 1:])
        return seen, np.concatenate(held, axis=1)

    def law(self, scaled: Mapping[str, float]) -> np.ndarray:
        """The slopes of outputs and integrals after a tick by the law's inputs and by its memory: [lane, of, by]."""
        actuator, parts, tape = self.actuator, self.actuator.parts, self.tape
        joint, own = actuator.use.joint, _held(parts)
        natural = [state.name for state in parts.natural]
        start = np.array([*self._seen(), *(tape.lane(f"{actuator.path}.{name}") for name in own)])
        moved, sizes = to_both_sides(start, _sizes(start, 2))
        values: list[Any] = list(moved)
        q, qd, states = values[0], values[1], dict(zip(natural, values[2:], strict=False))
        held = dict(zip(own, values[2 + len(natural) :], strict=True))
        times = 2 * len(start)
        still: Any = np.repeat(tape.lane(f"{joint}.q"), times) if actuator.command_kind == "position" else ZERO
        seen: Seen = self.builder.seen(actuator, q, qd, Setpoint(actuator.command_kind, still, ZERO), ZERO, states)
        control = law(actuator, self._values(times, scaled), NamedValues(actuator.owner, held), seen)
        after: dict[str, Any] = dict(control.outputs)
        after |= {name: held[name] + seen.period * x for name, x in control.slopes.items()}
        return differences(after, own, sizes)

    def drive(self, scaled: Mapping[str, float]) -> tuple[Any, ...]:
        """The slopes of the servo's physics by its outputs and states, at a nominal size, for comparison."""
        actuator, parts = self.actuator, self.actuator.parts
        held = dict.fromkeys(_held(parts), 0.3)
        states = NamedValues(actuator.owner, {part.name: 0.2 for part in parts.natural})
        motion = JointMotion(0.1, 0.1, 0.0, 0.0, actuator.command_kind)
        p = self._values(1, scaled)
        driven = answer(actuator.owner, actuator.servo.drive, p, NamedValues(actuator.owner, held), states, motion)
        numbers = (
            driven.torque,
            driven.rotor,
            driven.dry,
            driven.qdd,
            *driven.slopes.values(),
            *driven.friction.values(),
        )
        return tuple(tuple(np.atleast_1d(np.asarray(number, dtype=float)).tolist()) for number in numbers)

    def _seen(self) -> list[np.ndarray]:
        """The law's inputs without its sensors: the joint's motion as measured, then states of the servo."""
        actuator, tape = self.actuator, self.tape
        states: Any = {state.name: tape.lane(f"{actuator.path}.{state.name}") for state in actuator.parts.natural}
        q, qd = (tape.lane(f"{actuator.use.joint}.{part}") for part in ("q", "qd"))
        own: tuple[Any, Any] = q, qd
        of_joint = sensing.measured(actuator, self._values(1, {}), *own, NamedValues(actuator.owner, states))
        return [*(np.broadcast_to(np.asarray(quantity), tape.lanes) for quantity in of_joint), *states.values()]

    def _values(self, times: int, scaled: Mapping[str, float]) -> NamedValues:
        """The servo's parameters over lanes, some of them scaled."""
        read = spread_over(self.tape.read, times)
        p = self.system.servo_values(self.actuator, read)
        if not scaled:
            return p
        numbers = {parameter.name: getattr(p, parameter.name) for parameter in self.actuator.parts.parameters}
        numbers |= {name: numbers[name] * share for name, share in scaled.items()}
        return NamedValues(self.actuator.owner, numbers)

    def _reading(self, fitted: Fitted) -> np.ndarray:
        """The slopes of a sensor's reading, and of its memory after a tick, by quantity, states and memory: [lane, of,
        by], without noise. The slope is taken over several changes; the one that agrees best with its neighbour is
        kept."""
        tape, states, held = self.tape, [part.name for part in fitted.states], [part.name for part in fitted.memory]
        column = self.quantity_names().index(sensing.quantity(fitted))
        start = np.array([self._seen()[column], *(tape.lane(f"{fitted.path}.{name}") for name in (*states, *held))])
        count, sizes = len(start), len(READINGS)
        moved, changes = to_both_sides(np.repeat(start, sizes, axis=1), np.tile(READINGS, tape.lanes))
        values: list[Any] = list(moved)
        times = 2 * count * sizes
        p = sensing.values(self.system, fitted, spread_over(tape.read, times))
        inner = NamedValues(fitted.owner, dict(zip(states, values[1 : 1 + len(states)], strict=True)))
        memory = NamedValues(fitted.owner, dict(zip(held, values[1 + len(states) :], strict=True)))
        sensed = Sensed(lambda: values[0], self.actuator.use.divisor / self.builder.schedule.base_hz, lambda: 0.0)
        reading: Reading = answer(fitted.owner, fitted.sensor.read, p, memory, inner, sensed)
        slopes = differences({"": reading.value, **reading.held}, ("", *held), changes)
        return _agreed(slopes.reshape(tape.lanes, sizes, 1 + len(held), count))

    def quantity_names(self) -> tuple[str, ...]:
        """Names of the law's inputs."""
        return ("q", "qd", *(state.name for state in self.actuator.parts.natural))


def _held(parts: Parts) -> list[str]:
    """Names of a law's outputs and integrals."""
    return [*(output.name for output in parts.outputs), *(integral.name for integral in parts.integrals)]


def _sizes(start: np.ndarray, plain: int) -> np.ndarray:
    """The changes over which slopes are taken, of which the first are those of the joint's motion."""
    sizes = np.abs(start) * 1e-7 + SMALL_STATE
    sizes[:plain] = np.abs(start[:plain]) * SMALL + SMALL
    return sizes


def _agreed(slopes: np.ndarray) -> np.ndarray:
    """The slopes, among those over changes of several sizes, [lane, size, of, by], that differ least from those of the
    next size; 0 where all are 0."""
    own, other = slopes[:, :-1], slopes[:, 1:]
    larger = np.maximum(np.abs(own), np.abs(other))
    with np.errstate(all="ignore"):
        apart = np.where(larger > 0.0, np.abs(own - other) / larger, np.inf)
    best = np.argmin(np.round(np.where(np.isnan(apart), np.inf, apart), 6), axis=1)
    return np.take_along_axis(own, best[:, None], axis=1)[:, 0]
