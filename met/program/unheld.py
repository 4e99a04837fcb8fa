"""Servos that are to begin balanced and cannot hold their joints: the torques needed and available, and the limits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from met.backends.reference.plain import PlainTape
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan import Experiment, Joint, ServoUse
from met.program.balancing import Demand, demands, holds
from met.program.build import Builder
from met.program.cells import parameters
from met.program.evaluation import brake_levels
from met.program.system import System
from met.trace import Real

HALVINGS = 20
"""Number of halvings of the interval in which the share that a servo holds is sought: to a millionth."""


@frozen
class Unheld:
    """A joint whose servo cannot hold it as a run begins.

    wanted  torque that the joint takes, N m (N);  holdable: what of it the servo can hold, friction's help included
    limits  the servo's limits that stop it, by name, and as text with their units: those that do so alone, where there
            are any; none where no limit is in the way, and an integral with a gain of 0 holds nothing
    """

    joint: Joint
    servo: ServoUse
    wanted: float
    holdable: float
    limits: tuple[tuple[str, str], ...]

    @property
    def unit(self) -> str:
        """The unit of its torques, or forces."""
        return "N" if self.joint.kind == "prismatic" else "N m"

    @property
    def reason(self) -> str:
        """The limits that are in the way, and the remedy, in words."""
        if not self.limits:
            return (
                "none of its limits is in the way: an integral with a gain of 0 holds nothing; give the law an "
                "integral gain"
            )
        named = " and ".join(f"`{name}`, {text}," for name, text in self.limits)
        return f"{named} is too little: raise it or the gear's ratio, or lighten what the joint carries"


def unheld(experiment: Experiment, values: np.ndarray, *, commanded: bool = False) -> list[tuple[Unheld, ...]]:
    """For each case of these inputs, [case, input], the joints that are to begin balanced and that their servos cannot
    hold, in the arm's order. commanded: as for `holding.holds`."""
    by_case: list[tuple[Unheld, ...]] = [()] * len(values)
    if not experiment.structure.balanced or not len(values):
        return by_case
    begun = _Begun.of(experiment, values.T if len(values) > 1 else values[0])
    system = begun.system
    with np.errstate(all="ignore"):
        brakes = brake_levels(system, begun.tape.read, begun.y, 0.0, 0.0)
        for demand in begun.demands():
            joint = system.joints[demand.actuator.index]
            brake = brakes.get(joint.name, 0.0)
            judged = _Judged(system, begun.tape, demand, brake, len(values), commanded)
            for case in np.flatnonzero(~judged.held).tolist():
                by_case[case] = (*by_case[case], Unheld(joint, demand.actuator.use, *judged.of(case)))
    return by_case


def holding_torques(experiment: Experiment, inputs: Mapping[str, float]) -> dict[str, float]:
    """By joint, the torque with which a servo that is commanded a torque keeps its joint from accelerating as a run
    begins, N m (N). inputs: of one case, by name."""
    with np.errstate(all="ignore"):
        all_demands = _Begun.of(experiment, tuple(inputs.values()), tuple(inputs)).demands()
        return {
            demand.actuator.use.joint: float(demand.torque)
            for demand in all_demands
            if demand.actuator.command_kind == "torque"
        }


@frozen
class _Begun:
    """The start of a run of one case, or of several side by side, while its servos are unbalanced."""

    system: System
    tape: PlainTape
    y: Motion
    held: Mapping[str, Mapping[str, Real]]

    @classmethod
    def of(cls, experiment: Experiment, values: Iterable[Any], names: Sequence[str] | None = None) -> _Begun:
        """The start from values of the program's inputs, in the order of these names, or in the program's own."""
        system = System(experiment)
        builder = Builder(system)
        program = builder.program()
        tape = PlainTape(program, dict(zip(names or program.inputs, values, strict=True)), 1)
        with np.errstate(all="ignore"):
            held = builder.begin(tape)
            return cls(system, tape, builder.step.state(tape), held)

    def demands(self) -> Iterator[Demand]:
        """The demands of the start on each servo."""
        return demands(self.system, self.tape, self.y, self.held)


class _Judged:
    """One servo in many cases, whose numbers are arrays over these, or single where they do not vary."""

    def __init__(
        self, system: System, tape: PlainTape, demand: Demand, brake: Real, cases: int, commanded: bool
    ) -> None:
        self.system, self.tape, self.demand, self.cases = system, tape, demand, cases
        self._holds = partial(holds, brake=brake, commanded=commanded)
        self.wanted = self._over_cases(demand.torque)
        self.held = self._over_cases(self._holds(demand, demand.torque))

    def of(self, case: int) -> tuple[float, float, tuple[tuple[str, str], ...]]:
        """The result for this case: the torque that its joint takes, the part that it can hold, and the limits that
        stop it."""
        finite = [name for name, values in self.limits.items() if np.isfinite(values[case])]
        alone = [name for name in finite if self.without_one[name][case]]
        binding = alone or (finite if self.without_any[case] else [])
        known, path = self.system.experiment.parameters, self.demand.actuator.path
        texts = tuple((name, f"{self.limits[name][case]:.3g} {known[f'{path}.{name}'].unit}") for name in binding)
        return float(self.wanted[case]), float(self.wanted[case] * self.share[case]), texts

    @cached_property
    def share(self) -> np.ndarray:
        """The largest share of the torque that the servo holds, in each case."""
        low, high = np.zeros(self.cases), np.ones(self.cases)
        for _ in range(HALVINGS):
            middle: Any = 0.5 * (low + high)
            held: Any = self._holds(self.demand, middle * self.demand.torque)
            low, high = np.where(held, middle, low), np.where(held, high, middle)
        return low

    @cached_property
    def limits(self) -> dict[str, np.ndarray]:
        """The servo's limits in each case, by name."""
        parts = self.demand.actuator.parts
        declared = [*(part.limit for part in parts.outputs), *(part.limit for part in parts.signals)]
        return {name: self._over_cases(getattr(self.demand.p, name)) for name in dict.fromkeys(declared) if name}

    @cached_property
    def without_one(self) -> dict[str, np.ndarray]:
        """The cases in which the servo would hold its joint without the limit, by the limit's name."""
        return {name: self._without(name) for name in self.limits}

    @cached_property
    def without_any(self) -> np.ndarray:
        """The cases in which the servo would hold its joint without any limit."""
        return self._without(*self.limits)

    def _without(self, *names: str) -> np.ndarray:
        """True of each case in which the servo could hold its joint if these limits of it were infinite."""
        actuator = self.demand.actuator
        numbers = parameters(
            actuator.owner,
            actuator.path,
            actuator.parts.parameters,
            lambda path: np.inf if path.rpartition(".")[2] in names else self.system.value(path, self.tape.read),
        )
        return self._over_cases(self._holds(replace(self.demand, p=numbers), self.demand.torque))

    def _over_cases(self, value: object) -> np.ndarray:
        return np.broadcast_to(np.asarray(value), (self.cases,))
