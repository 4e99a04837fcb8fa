"""Sensors of joints: what a servo's law sees in the stead of how things are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from met.diagnostic import Problem, error
from met.plan import REPEAT, SEED
from met.program.machine import Actuator, Fitted, Machine, ReadCell
from met.program.values import Values, answer, parameters, returned
from met.sensors.sensor import Reading, Sensed
from met.servos.servo import Seen
from met.trace import Real
from met.trace.noise import Stream, normal
from met.trace.program import Tape


def truth(seen: Seen, of: str) -> Real:
    """The quantity itself."""
    found: Real = getattr(seen, of) if of in ("q", "qd") else getattr(seen.states, of)
    return found


def start(machine: Machine, tape: Tape, actuator: Actuator, seen: Seen) -> None:
    """States, memory and reading where a run begins."""
    for fitted in actuator.sensors:
        value = truth(seen, fitted.use.of)
        found = answer(fitted.owner, fitted.sensor.begin, values(machine, fitted, tape.read), value)
        names = [*(state.name for state in fitted.states), *(memory.name for memory in fitted.memory)]
        returned(fitted.owner, "begin", found, names)
        for name, number in found.items():
            tape.write(f"{fitted.path}.{name}", number)
        tape.write(fitted.path, value)


def slopes(
    machine: Machine, actuator: Actuator, read: ReadCell, seen: Seen, own: Mapping[str, Real]
) -> dict[str, Real]:
    """Slopes of the sensors' states at a stage, by channel. own: the states, by channel."""
    found: dict[str, Real] = {}
    for fitted in actuator.sensors:
        if fitted.sensor.follow is None:
            continue
        value = truth(seen, fitted.use.of)
        p, states = values(machine, fitted, read), _states(fitted, own.__getitem__)
        new = answer(fitted.owner, fitted.sensor.follow, p, states, value)
        returned(fitted.owner, "follow", new, (state.name for state in fitted.states))
        found.update({f"{fitted.path}.{name}": slope for name, slope in new.items()})
    return found


def through(machine: Machine, actuator: Actuator, read: ReadCell, seen: Seen, own: Mapping[str, Real]) -> Seen:
    """What a continuous law sees through its sensors at a stage."""

    def never() -> Real:
        raise Problem(error("E213", "a sensor that a continuous law sees draws noise", help="declare it `clocked`"))

    for fitted in actuator.sensors:
        sensed = Sensed(truth(seen, fitted.use.of), 0.0, never)
        p, states = values(machine, fitted, read), _states(fitted, own.__getitem__)
        reading = answer(fitted.owner, fitted.sensor.read, p, Values(fitted.owner, {}), states, sensed)
        seen = _with(actuator, seen, fitted.use.of, reading.value)
    return seen


def ticked(machine: Machine, tape: Tape, actuator: Actuator, seen: Seen, state: Callable[[str], Real]) -> Seen:
    """What a sampled law sees through its sensors at a tick. state: gives their states, by channel."""
    cases = machine.experiment.cases
    found = seen
    for fitted in actuator.sensors:
        seed = tape.input(SEED) if SEED in cases.noise else float(cases.seed)
        repeat = tape.input(REPEAT) if REPEAT in cases.noise else 0.0
        stream, tick = Stream(seed, repeat, fitted.path), tape.tick / float(actuator.use.divisor)
        sensed = Sensed(truth(seen, fitted.use.of), seen.period, lambda s=stream, k=tick: normal(s, k))  # type: ignore[misc]
        p = values(machine, fitted, tape.read)
        held = Values(fitted.owner, {part.name: tape.read(f"{fitted.path}.{part.name}") for part in fitted.memory})
        reading: Reading = answer(fitted.owner, fitted.sensor.read, p, held, _states(fitted, state), sensed)
        returned(fitted.owner, "read", reading.held, (memory.name for memory in fitted.memory))
        for name, number in reading.held.items():
            tape.write(f"{fitted.path}.{name}", number)
        tape.write(fitted.path, reading.value)
        found = _with(actuator, found, fitted.use.of, reading.value)
    return found


def values(machine: Machine, fitted: Fitted, read: ReadCell) -> Values:
    """The sensor's parameters."""
    return parameters(fitted.owner, fitted.path, fitted.parameters, lambda path: machine.value(path, read))


def _states(fitted: Fitted, state: Callable[[str], Real]) -> Values:
    return Values(fitted.owner, {part.name: state(f"{fitted.path}.{part.name}") for part in fitted.states})


def _with(actuator: Actuator, seen: Seen, of: str, value: Real) -> Seen:
    """What is seen, with this quantity replaced."""
    if of in ("q", "qd"):
        return replace(seen, q=value) if of == "q" else replace(seen, qd=value)
    numbers: dict[str, Any] = {part.name: getattr(seen.states, part.name) for part in actuator.parts.natural}
    return replace(seen, states=Values(actuator.owner, numbers | {of: value}))
