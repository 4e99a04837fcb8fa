"""Failures of servos by environment models: they release a joint, or replace the servo's outputs or readings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from met.diagnostic import Problem, error
from met.environments.environment import Environment
from met.frozen import frozen
from met.program.control.sensing import true_value, with_value
from met.program.system import Actuator, ReadCell, System
from met.program.values import NamedValues, answer, parameters, returned
from met.servos.servo import Control, Seen
from met.trace import Real


@frozen
class StepTimes:
    """The begin of a step of the dynamics, and its length, s: a `met.environments.environment.Step`."""

    begin: Real
    step: float


def coupled(system: System, actuator: Actuator, read: ReadCell, begin: Real) -> Real | None:
    """The servo's hold on its joint, 0 to 1, in the step that began then; None where nothing ever lets it go."""
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
