"""The duration of a joint's contact with a stop, in steps: half a swing of the arm on the stop's spring."""

from __future__ import annotations

import math

import numpy as np

from met.backends.reference.plain import PlainTape, follow
from met.frozen import frozen
from met.plan import Experiment
from met.program.build import Builder
from met.program.motion.world import environment_values
from met.program.system import System
from met.run import inputs


@frozen
class Contact:
    """A stop of one case, by its name in the environment: the joint, the inertia at the joint at the start (kg m^2;
    kg), and the steps that a contact takes there."""

    stop: str
    joint: str
    inertia: float
    steps: float


def contacts(experiment: Experiment, case: int = 0) -> tuple[Contact, ...]:
    """The contacts with every stop that may push its joint, for the arm as it begins in this case.

    `inertia` is that of the arm at the joint, where all others keep their modes, and of its rotor. A joint without
    inertia is left out.
    """
    system = System(experiment)
    stops = [(name, model) for name, model in system.environment if model.springs]
    if not stops:
        return ()
    builder = Builder(system)
    program = builder.program()
    values = inputs(experiment, np.array([case]))[0]
    tape = PlainTape(program, dict(zip(program.inputs, values, strict=True)), 1)
    found = []
    with np.errstate(all="ignore"):
        follow(tape, program.start)
        follow(tape, program.tick)
        arm = builder.step.observed(tape)
        for name, model in stops:
            _, p = environment_values(system, name, model, tape.read)
            if model.idle is not None and model.idle(p, experiment.structure.schedule.duration) is not None:
                continue
            joint, stiffness = (system.value(f"environment.{name}.{part}", tape.read) for part in model.springs)
            number = next(i for i, each in enumerate(system.joints) if each.name == joint)
            actuator = system.actuators[number]
            if (actuator is not None and actuator.gives) or system.joints[number].follows:
                continue
            inertia = float(arm.effective(number)[0] + arm.derivative.solved.rotor[number])
            if not inertia > 0.0:  # masses so small that the inertia is 0 after rounding
                continue
            lasts = math.pi * math.sqrt(inertia / stiffness) if stiffness > 0.0 else math.inf
            found.append(Contact(name, str(joint), inertia, lasts / experiment.structure.schedule.step))
    return tuple(found)
