"""The duration of contacts in steps: of a joint with a stop, half a swing on its spring; of bodies, by their law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from met.backends.reference.plain import PlainTape, begun
from met.environments.environment import Environment, Loads
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan import Experiment
from met.program import cells
from met.program.build import Builder
from met.program.motion.base import ArmWorld, base_of, environment_values
from met.program.motion.bodies import tree_with_payloads
from met.program.system import System
from met.run import inputs
from met.vectors import scale

USUAL_RATE = 1.0
"""The rate, m/s, at which bodies are taken to meet that do not approach each other when the run begins."""


@frozen
class Contact:
    """A contact of one case, by its name in the environment.

    body     what is pushed back, in words: a joint, or a link
    inertia  that the contact feels at the start, in `unit`: of the joint, or the reduced mass of two bodies
    steps    that it takes
    """

    stop: str
    body: str
    inertia: float
    unit: str
    steps: float


def contacts(experiment: Experiment, case: int = 0) -> tuple[Contact, ...]:
    """The contacts with every stop that may push its joint, and of bodies, for the arm as it begins in this case.

    `inertia` is that of the arm at the joint, where all others keep their modes, and of its rotor. What has none is
    left out, and so are bodies that nothing moves apart.
    """
    system = System(experiment)
    stops = [(name, model) for name, model in system.environment if model.springs]
    if not stops:
        return ()
    builder = Builder(system)
    program = builder.program()
    tape = begun(program, dict(zip(program.inputs, inputs(experiment, np.array([case]))[0], strict=True)))
    all_contacts = []
    step = experiment.structure.schedule.step
    with np.errstate(all="ignore"):
        arm = builder.step.observed(tape)
        solved = arm.derivative.solved  # before bodies are pushed
        for name, model in stops:
            _, p = environment_values(system, name, model, tape.read)
            if model.idle is not None and model.idle(p, experiment.structure.schedule.duration) is not None:
                continue
            moved = system.value(f"environment.{name}.{model.springs[0]}", tape.read)
            if model.touch is not None and model.lasts is not None:
                inertia, rate = _meeting(builder, tape, name, model, p)
                if 0.0 < inertia < math.inf:
                    steps = model.lasts(p, inertia, rate if rate > 0.0 else USUAL_RATE) / step
                    all_contacts.append(Contact(name, f"`{moved}`", inertia, "kg", steps))
                continue
            number = next(i for i, joint in enumerate(system.joints) if joint.name == moved)
            actuator = system.actuators[number]
            if (actuator is not None and actuator.gives) or system.joints[number].follows:
                continue
            inertia = float(arm.effective(number)[0] + solved.rotor[number])
            if not inertia > 0.0:  # masses so small that the inertia is 0 after rounding
                continue
            stiffness = system.value(f"environment.{name}.{model.springs[1]}", tape.read)
            lasts = math.pi * math.sqrt(inertia / stiffness) if stiffness > 0.0 else math.inf
            unit = "kg" if system.joints[number].kind == "prismatic" else "kg m^2"
            all_contacts.append(Contact(name, f"joint `{moved}`", inertia, unit, lasts / step))
    return tuple(all_contacts)


def _meeting(builder: Builder, tape: PlainTape, name: str, model: Environment, p: Any) -> tuple[float, float]:
    """The reduced mass of two bodies where they would touch, kg, and the rate at which they approach there, m/s.

    The mass is that of a push of 1 N along the normal: what it changes in the accelerations is put in the place of
    rates. Joints keep their modes, but dry friction holds none.
    """
    system, y, tree = builder.system, builder.step.state(tape), tree_with_payloads(builder.system, tape.read)

    def touch(qd: Sequence[Any]) -> Any:
        moving = Motion(y.q, tuple(qd), y.x)
        base = base_of(system, tape.read, moving, 0.0)
        return model.touch(p, ArmWorld(system, tape.read, tree, moving, base, 0.0, 0.0))  # type: ignore[misc]

    def approach(push: float) -> float:
        """The acceleration at which the bodies approach, m/s^2, under a push of this size at the contact, N."""
        touching = touch(y.qd)
        force = touching.forces(p, scale(push, touching.normal))
        vars(system)["environment"] = ((name, replace(model, loads=lambda p, world: Loads(forces=force))),)
        return float(touch(builder.step.observed(tape).derivative.slope.qdd).rate)

    for sticking in builder.step.sticking:
        tape.write(cells.FRICTION_MODE(sticking.name), 1.0)
    every = system.environment
    parts = approach(0.0) - approach(1.0)
    vars(system)["environment"] = every
    return 1.0 / parts if parts > 0.0 else math.inf, float(touch(y.qd).rate)
