"""Sensors at work, with their states and readings at ticks; and failures of servos by environment models."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from met.diagnostic import Problem, error
from met.environments.environment import Environment
from met.frozen import frozen
from met.plan import REPEAT, SEED, SensorUse
from met.program.cells import NamedValues, answer, parameters, returned
from met.program.system import Actuator, Fitted, ReadCell, System
from met.sensors.sensor import Reading, Sensed
from met.servos.servo import Control, Seen
from met.trace import Real
from met.trace.noise import Stream, normal
from met.trace.program import Tape

READING = "sensors"
"""The name of the part of a tick in which a sensor reads, or a bed's converters work
(`met.trace.program.Tape.part`)."""


def measured(actuator: Actuator, p: NamedValues, q: Real, qd: Real, states: NamedValues) -> tuple[Real, Real]:
    """Position and rate at the servo's encoder and tachometer, for a joint with this motion."""
    if actuator.servo.measured is None:
        return q, qd
    return answer(actuator.owner, actuator.servo.measured, p, q, qd, states)


def true_value(seen: Seen, name: str) -> Real:
    """The true value of a quantity."""
    value: Real = getattr(seen, name) if name in ("q", "qd") else getattr(seen.states, name)
    return value


def start(system: System, tape: Tape, actuator: Actuator, seen: Seen) -> None:
    """Write states, memory and reading where a run begins."""
    for fitted in actuator.sensors:
        value = true_value(seen, quantity(fitted))
        begin(system, tape, fitted, value)


def slopes(system: System, actuator: Actuator, read: ReadCell, seen: Seen, own: Mapping[str, Real]) -> dict[str, Real]:
    """Slopes of the sensors' states at a stage, by channel. own: the states, by channel."""
    by_channel: dict[str, Real] = {}
    for fitted in actuator.sensors:
        if fitted.sensor.follow is None:
            continue
        by_channel.update(sensor_slopes(system, fitted, read, own, true_value(seen, quantity(fitted))))
    return by_channel


def seen_at_stage(system: System, actuator: Actuator, read: ReadCell, seen: Seen, own: Mapping[str, Real]) -> Seen:
    """Inputs of a continuous law at a stage, through its sensors."""

    def never() -> Real:
        raise Problem(error("E213", "a sensor that a continuous law sees draws noise", help="declare it `clocked`"))

    for fitted in actuator.sensors:
        sensed = Sensed(partial(true_value, seen, quantity(fitted)), 0.0, never)
        p, states = values(system, fitted, read), _states(fitted, own.__getitem__)
        reading = answer(fitted.owner, fitted.sensor.read, p, NamedValues(fitted.owner, {}), states, sensed)
        seen = with_value(actuator, seen, quantity(fitted), reading.value)
    return seen


def seen_at_tick(system: System, tape: Tape, actuator: Actuator, seen: Seen, state: Callable[[str], Real]) -> Seen:
    """Inputs of a sampled law at a tick, through its sensors. state: gives their states, by channel."""
    through = seen
    for fitted in actuator.sensors:
        name = quantity(fitted)
        value = tick(system, tape, fitted, partial(true_value, seen, name), actuator.use.divisor, seen.period, state)
        through = with_value(actuator, through, name, value)
    return through


# One sensor


def begin(system: System, tape: Tape, fitted: Fitted, value: Real) -> None:
    """Write states, memory and reading where a run begins, after the quantity has been at this value."""
    memory = answer(fitted.owner, fitted.sensor.begin, values(system, fitted, tape.read), value)
    names = [*(state.name for state in fitted.states), *(memory.name for memory in fitted.memory)]
    returned(fitted.owner, "begin", memory, names)
    for name, number in memory.items():
        tape.write(f"{fitted.path}.{name}", number)
    tape.write(fitted.path, value)


def sensor_slopes(
    system: System, fitted: Fitted, read: ReadCell, own: Mapping[str, Real], value: Real
) -> dict[str, Real]:
    """Slopes of the states of a sensor that has a circuit, by channel. own: the states, by channel."""
    assert fitted.sensor.follow is not None
    p, states = values(system, fitted, read), _states(fitted, own.__getitem__)
    new = answer(fitted.owner, fitted.sensor.follow, p, states, value)
    returned(fitted.owner, "follow", new, (state.name for state in fitted.states))
    return {f"{fitted.path}.{name}": slope for name, slope in new.items()}


def tick(
    system: System,
    tape: Tape,
    fitted: Fitted,
    find: Callable[[], Real],
    divisor: int,
    period: float,
    state: Callable[[str], Real],
) -> Real:
    """The reading of a sensor at a tick of its computer; its memory advances by a tick.

    find   gives the quantity;  state  its states, by channel
    """
    stream, number = Stream(*seed_and_repeat(system, tape), fitted.path), tape.tick / float(divisor)
    sensed = Sensed(find, period, partial(normal, stream, number))
    p = values(system, fitted, tape.read)
    held = NamedValues(fitted.owner, {part.name: tape.read(f"{fitted.path}.{part.name}") for part in fitted.memory})
    with tape.part(READING):
        reading: Reading = answer(fitted.owner, fitted.sensor.read, p, held, _states(fitted, state), sensed)
    returned(fitted.owner, "read", reading.held, (memory.name for memory in fitted.memory))
    for name, new in reading.held.items():
        tape.write(f"{fitted.path}.{name}", new)
    tape.write(fitted.path, reading.value)
    return reading.value


def seed_and_repeat(system: System, tape: Tape) -> tuple[Real, Real]:
    """The seed of a case's noise, and the number of its repeat: inputs of the program where cases differ in them."""
    cases = system.experiment.cases
    seed = tape.input(SEED) if SEED in cases.noise else float(cases.seed)
    return seed, tape.input(REPEAT) if REPEAT in cases.noise else 0.0


def quantity(fitted: Fitted) -> str:
    """Name of the quantity that a joint's sensor reads."""
    assert isinstance(fitted.use, SensorUse)
    return fitted.use.of


def values(system: System, fitted: Fitted, read: ReadCell) -> NamedValues:
    """The sensor's parameters."""
    return parameters(fitted.owner, fitted.path, fitted.parameters, lambda path: system.value(path, read))


def _states(fitted: Fitted, state: Callable[[str], Real]) -> NamedValues:
    return NamedValues(fitted.owner, {part.name: state(f"{fitted.path}.{part.name}") for part in fitted.states})


def with_value(actuator: Actuator, seen: Seen, name: str, value: Real) -> Seen:
    """The inputs of a law with this quantity replaced."""
    if name in ("q", "qd"):
        return replace(seen, q=value) if name == "q" else replace(seen, qd=value)
    numbers: dict[str, Any] = {part.name: getattr(seen.states, part.name) for part in actuator.parts.natural}
    return replace(seen, states=NamedValues(actuator.owner, numbers | {name: value}))


@frozen
class StepTimes:
    """The begin of a step of the dynamics, and its length, s: a `met.environments.environment.Step`."""

    begin: Real
    step: float


def coupled(system: System, actuator: Actuator, read: ReadCell, begin: Real) -> Real | None:
    """The share from 0 to 1 with which the servo holds its joint in the step that began then; None where nothing ever
    lets it go."""
    held: Real | None = None
    step = StepTimes(begin, system.structure.schedule.step)
    for owner, model, p in _about(system, actuator, read):
        if model.decoupling is not None:
            own = 1.0 - answer(owner, model.decoupling, p, step)
            held = own if held is None else held * own
    return held


def law_outputs(
    system: System, actuator: Actuator, read: ReadCell, p: NamedValues, time: Real, control: Control
) -> Control:
    """Outputs of the servo's law, some replaced by environment models."""
    for owner, model, own in _about(system, actuator, read):
        if model.replaced_outputs is None:
            continue
        if actuator.servo.full is None:
            message = f"{owner}: {actuator.owner} has no drive that could run away"
            raise Problem(error("E219", message, actuator.use.place, help="leave it out for this joint"))
        full = answer(actuator.owner, actuator.servo.full, p)
        outputs = answer(owner, model.replaced_outputs, own, time, control.outputs, full)
        control = replace(control, outputs=returned(owner, "replaced_outputs", outputs, control.outputs))
    return control


def seen(system: System, actuator: Actuator, read: ReadCell, seen: Seen, last: str | None) -> Seen:
    """Inputs of the law, some replaced by environment models.

    last  prefix of the cells that hold what it saw at its last tick; None: there is none
    """
    for owner, model, p in _about(system, actuator, read):
        if model.replaced_reading is None:
            continue
        for quantity in quantities(actuator):
            before = math.nan if last is None else read(f"{last}{quantity}")
            seen = with_value(
                actuator,
                seen,
                quantity,
                answer(owner, model.replaced_reading, p, seen.time, quantity, true_value(seen, quantity), before),
            )
    return seen


def quantities(actuator: Actuator) -> tuple[str, ...]:
    """Names of the quantities of its joint that a law sees."""
    return ("q", "qd", *(state.name for state in actuator.parts.natural))


def _about(system: System, actuator: Actuator, read: ReadCell) -> Iterator[tuple[str, Environment, NamedValues]]:
    """The models about this servo: each with its name in messages, its declaration and its parameters."""
    for name, model in system.failing.get(actuator.use.joint, ()):
        owner = f"environment model `{model.name}` (as `{name}`)"
        p = parameters(owner, f"environment.{name}", model.parameters, lambda path: system.value(path, read))
        yield owner, model, p
