"""Limits that a run reaches: the number of steps that begin at each, and those at which a required metric took its
extreme.

A motor's limit is read off the channel that never exceeds it; an environment model or a command's course is asked for
its own (`met.plan.limits`). All of it is outside of the state: no bit of a run depends on it.
"""

from __future__ import annotations

from met import models
from met.plan.limits import LimitUse, extremes, limits
from met.program import cells
from met.program.cells import answer
from met.program.control.guiding import course_values
from met.program.motion.base import ArmWorld, base_of, environment_values
from met.program.motion.bodies import tree_with_payloads
from met.program.observe import excess
from met.program.step import StepPhases
from met.program.system import System
from met.trace import Real, Truth, absolute, any_of, maximum, where
from met.trace.program import CallPhase, Control, Phase, RunPhase, Tape, WhileAny

ANY = "at_any_limit"
"""Cell: 1 where the step that ends now began at a limit."""


class LimitPhases:
    """The limits of one system, counted at each step and examined where a metric takes a new extreme."""

    def __init__(self, system: System, step: StepPhases) -> None:
        self.system, self.step = system, step
        self.uses = limits(system.structure, system.experiment.parameters)
        self.extremes = extremes(system.experiment)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Outputs: steps that began at each limit; largest excesses over joints' own; for each judged metric, the limit
        at its extreme."""
        counts = (cells.AT_LIMIT(use.path) for use in self.uses)
        most = (cells.EXCESS(use.path) for use in self.uses if use.bound)
        return (*counts, *most, *(cells.EXTREME_AT(name) for name in self.extremes))

    def counting(self) -> tuple[Control, ...]:
        """Phases that count the limits at which the step that ends now began; run before that step is finished."""
        if not self.uses:
            return ()
        count = WhileAny(ANY, 1, (RunPhase(Phase("count_limits", self._count)),))
        # a piece of its own, so that the code of the motion is the same as without it
        return (CallPhase(Phase("limits", self._look)), count)

    def _look(self, tape: Tape) -> None:
        """Note whether any limit is reached, which is rare: so counting costs next to nothing."""
        tape.write_mask(ANY, any_of([reached for _, reached in self._at_begin(tape)]))

    def _count(self, tape: Tape) -> None:
        for path, reached in self._at_begin(tape):
            cells.count(tape, reached, cells.AT_LIMIT(path))
        self.keep_excess(tape)

    def keep_excess(self, tape: Tape) -> None:
        """Keep the largest excess over each limit of a joint, including this instant."""
        for use in self.uses:
            if use.bound:
                cell = cells.EXCESS(use.path)
                tape.write(cell, maximum(tape.read(cell), self._excess(tape, use)))

    def _excess(self, tape: Tape, use: LimitUse) -> Real:
        return excess(use.joint, use.bound, self.system.value(use.path, tape.read), tape.read)

    def _at_begin(self, tape: Tape) -> list[tuple[str, Truth]]:
        """Paths of limits, and whether the step that ends now began there."""
        began = tape.read("instant")
        return [(use.path, self._reached(tape, use, began)) for use in self.uses]

    def at_extreme(self, tape: Tape, name: str, is_new: Truth) -> None:
        """Keep the number, from 1, of the limit that is reached where this metric has a new extreme: among several the
        last, which is nearest to the joint."""
        last: Real = 0.0
        for number, use in enumerate(self.extremes[name], 1):
            last = where(self._reached(tape, use, tape.time), float(number), last)
        cells.keep(tape, is_new, cells.EXTREME_AT(name), last)

    def _reached(self, tape: Tape, use: LimitUse, time: Real) -> Truth:
        """True where a limit is reached at this time, s."""
        system = self.system
        if use.bound:
            return self._excess(tape, use) > 0.0
        if use.channels:
            most = system.value(use.path, tape.read)
            return any_of([absolute(tape.read(channel)) >= most for channel in use.channels])
        assert use.declared is not None
        if not use.owner:
            actuator = next(other for other in system.working if other.use.joint == use.joint)
            p = course_values(system, actuator, tape.read)
            return answer(actuator.owner, use.declared.reached, p, time)
        model = models.find("environment", next(e.model for e in system.structure.environment if e.name == use.owner))
        owner, p = environment_values(system, use.owner, model, tape.read)
        y, tree = self.step.state(tape), tree_with_payloads(system, tape.read)
        world = ArmWorld(system, tape.read, tree, y, base_of(system, tape.read, y, time), time, time)
        return answer(owner, use.declared.reached, p, world)
