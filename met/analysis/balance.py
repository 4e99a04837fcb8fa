"""Servos that are to begin balanced and cannot hold their joints: what these take, what they get, what limits it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from met.backends.reference.plain import PlainTape
from met.frozen import frozen
from met.plan import Experiment, Joint, ServoUse
from met.program.balancing import Demand, demands
from met.program.build import Builder
from met.program.evaluation import brake_levels
from met.program.holding import holds
from met.program.system import System
from met.program.values import parameters
from met.run import inputs


@frozen
class Unheld:
    """A joint whose servo cannot hold it as a run begins.

    wanted  torque that the joint takes, N m (N);  there: what of it the servo can hold, friction's help included
    limits  the servo's limits that stop it, by name, and as text with their units: those that do so alone, where there
            are any; none where no limit is in the way, and an integral with a gain of 0 holds nothing
    """

    joint: Joint
    servo: ServoUse
    wanted: float
    there: float
    limits: tuple[tuple[str, str], ...]

    @property
    def unit(self) -> str:
        """The unit of its torques, or forces."""
        return "N" if self.joint.kind == "prismatic" else "N m"

    @property
    def reason(self) -> str:
        """What is in the way, and what to do."""
        if not self.limits:
            return (
                "none of its limits is in the way: an integral with a gain of 0 holds nothing; give the law an "
                "integral gain"
            )
        named = " and ".join(f"`{name}`, {text}," for name, text in self.limits)
        return f"{named} is too little: raise it or the gear's ratio, or lighten what the joint carries"


def unheld(experiment: Experiment, case: int = 0) -> tuple[Unheld, ...]:
    """The joints that are to begin balanced in this case and cannot be held, in the arm's order."""
    if not experiment.structure.balanced:
        return ()
    system = System(experiment)
    builder = Builder(system)
    program = builder.program()
    values = inputs(experiment, np.array([case]))[0]
    tape = PlainTape(program, dict(zip(program.inputs, values, strict=True)), 1)
    found = []
    with np.errstate(all="ignore"):
        begun = builder.begin(tape)
        y = builder.step.state(tape)
        brakes = brake_levels(system, tape.read, y, 0.0, 0.0)
        for demand in demands(system, tape, y, begun):
            joint, use = system.joints[demand.actuator.index], demand.actuator.use
            brake, wanted = float(brakes.get(joint.name, 0.0)), float(demand.torque)
            if not holds(demand, demand.torque, brake):
                there = wanted * _share(demand, brake)
                found.append(Unheld(joint, use, wanted, there, _limits(system, tape, demand, brake)))
    return tuple(found)


def _share(demand: Demand, brake: float) -> float:
    """The largest share of the torque that the servo holds, to a millionth."""
    low, high = 0.0, 1.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(demand, middle * demand.torque, brake) else (low, middle)
    return low


def _limits(system: System, tape: PlainTape, demand: Demand, brake: float) -> tuple[tuple[str, str], ...]:
    """The limit without which the servo would hold its joint, else all without which together it would."""
    actuator, parts = demand.actuator, demand.actuator.parts
    declared = [*(part.limit for part in parts.outputs), *(part.limit for part in parts.signals)]
    named = [name for name in dict.fromkeys(declared) if name and np.isfinite(getattr(demand.p, name))]

    def without(*names: str) -> bool:
        numbers = parameters(
            actuator.owner,
            actuator.path,
            parts.parameters,
            lambda path: np.inf if path.rpartition(".")[2] in names else system.value(path, tape.read),
        )
        return bool(holds(replace(demand, p=numbers), demand.torque, brake))

    alone = [name for name in named if without(name)]
    binding = alone or (named if without(*named) else [])
    quantities = system.experiment.parameters
    units = {name: quantities[f"{actuator.path}.{name}"].unit for name in binding}
    return tuple((name, f"{float(getattr(demand.p, name)):.3g} {units[name]}") for name in binding)
