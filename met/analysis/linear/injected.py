"""The program of an experiment with inputs: numbers added to what servos are asked, and to what their laws put out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from met.frozen import frozen
from met.program.build import Builder
from met.program.system import Actuator, System
from met.servos.servo import Seen, Setpoint
from met.trace.program import Tape

ADDED = "added:"
"""Before the path of an input: the cell of what is added to it, 0 where nothing is."""


@frozen
class InputSignal:
    """A signal that may be an input: of a servo that ticks, its command or an output of its law.

    path      of its channel: `pan.servo.command`, `pan.servo.voltage`
    divisor   ticks of the base rate from one to the next
    is_output whether a law puts it out, so that its loop may be opened there
    """

    path: str
    joint: str
    divisor: int
    is_output: bool


def entries(system: System) -> tuple[InputSignal, ...]:
    """The signals of a system that may be inputs, joint by joint: commands, then outputs of laws."""
    found = []
    for actuator in system.working:
        if not actuator.ticks:
            continue
        joint, divisor = actuator.use.joint, actuator.use.divisor
        if actuator.command_kind != "none":
            found.append(InputSignal(f"{actuator.path}.command", joint, divisor, False))
        found += [InputSignal(f"{actuator.path}.{each.name}", joint, divisor, True) for each in actuator.parts.outputs]
    return tuple(found)


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
