"""A program with additional inputs: numbers added to the commands of servos and to the outputs of their laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from met.plan.linear_signals import InputSignal
from met.program.build import Builder
from met.program.system import Actuator, System
from met.servos.servo import Seen, Setpoint
from met.trace.program import Tape

ADDED = "added:"
"""Prefix of an input's path: the cell of the number added to it, normally 0."""


class InjectedBuilder(Builder):
    """Builder of a program's phases that adds the inputs where commands and outputs are made."""

    def __init__(self, system: System, inputs: Sequence[InputSignal]) -> None:
        super().__init__(system)
        self._added = frozenset(signal.path for signal in inputs)

    def setpoint(self, tape: Tape, actuator: Actuator) -> Setpoint:
        setpoint, path = super().setpoint(tape, actuator), f"{actuator.path}.command"
        return replace(setpoint, value=setpoint.value + tape.read(ADDED + path)) if path in self._added else setpoint

    def compute(self, tape: Tape, actuator: Actuator, seen: Seen) -> None:
        super().compute(tape, actuator, seen)
        for output in actuator.parts.outputs:
            path = f"{actuator.path}.{output.name}"
            if path in self._added:
                tape.write(path, tape.read(path) + tape.read(ADDED + path))
