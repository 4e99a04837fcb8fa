"""The program of an experiment with inputs: numbers added to what servos are asked, and to what their laws put out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from met.plan.linear_signals import InputSignal
from met.program.build import Builder
from met.program.system import Actuator, System
from met.servos.servo import Seen, Setpoint
from met.trace.program import Tape

ADDED = "added:"
"""Before the path of an input: the cell of what is added to it, 0 where nothing is."""


class InjectedBuilder(Builder):
    """A program's phases with something added to inputs where they are made."""

    def __init__(self, system: System, inputs: Sequence[InputSignal]) -> None:
        super().__init__(system)
        self._added = frozenset(each.path for each in inputs)

    def setpoint(self, tape: Tape, actuator: Actuator) -> Setpoint:
        found, path = super().setpoint(tape, actuator), f"{actuator.path}.command"
        return replace(found, value=found.value + tape.read(ADDED + path)) if path in self._added else found

    def compute(self, tape: Tape, actuator: Actuator, seen: Seen) -> None:
        super().compute(tape, actuator, seen)
        for output in actuator.parts.outputs:
            path = f"{actuator.path}.{output.name}"
            if path in self._added:
                tape.write(path, tape.read(path) + tape.read(ADDED + path))
