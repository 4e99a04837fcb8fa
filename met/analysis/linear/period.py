"""The program of an experiment over one period of all its computers, with tangents, and its states.

A period is as long as it takes until the dynamics and all computers tick together again. It begins at an instant, when
the step that ends there is finished and nothing has ticked yet: so a value that a computer computes anew from its
inputs is no state, and its memory is. A state is a cell that the period reads before it writes it, and that moves with
the arm or with an input.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

from met.plan import Experiment, Recorded
from met.plan.linear_signals import InputSignal
from met.program.build import Builder
from met.program.control import guiding
from met.program.control.sensing import READING
from met.program.motion import bodies
from met.program.system import Actuator, System
from met.servos.servo import Seen, Setpoint
from met.trace.program import Branch, CodeSection, RecordedControl, RecordSection, Tape, Unless0, WhileAny, sections_in
from met.trace.recorder import record
from met.trace.tangents import TangentSection, moved_by, with_tangents

if TYPE_CHECKING:
    from met import run as engine


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
        """Compute a servo's outputs, and add an input to each at which a loop is opened: the program is differentiated
        by it."""
        super().compute(tape, actuator, seen)
        for output in actuator.parts.outputs:
            path = f"{actuator.path}.{output.name}"
            if path in self._added:
                tape.write(path, tape.read(path) + tape.read(ADDED + path))


class PeriodProgram:
    """An experiment's program, recorded with tangents.

    inputs   what something is added to at each of its ticks
    outputs  variables that are recorded at the period's begin

    `positions`, `rates` and `turns` are the arm's cells of these kinds, `of_beds` the memory of emulated beds.
    """

    def __init__(
        self, experiment: Experiment, inputs: Sequence[InputSignal] = (), outputs: Sequence[Recorded] = ()
    ) -> None:
        structure = replace(experiment.structure, metrics=(), record=tuple(outputs))
        self.experiment, self.inputs = experiment, tuple(inputs)
        self.system = System(replace(experiment, structure=structure))
        self.builder = InjectedBuilder(self.system, inputs)
        self.schedule = structure.schedule
        program = self.builder.program()
        added = tuple(ADDED + signal.path for signal in inputs)
        self.recording = record(replace(program, counters=(*program.counters, *added)), fuse=False)
        finish, *rest = self.recording.tick
        self.finish, self.rest = (finish,), tuple(rest)
        self.columns = tuple(path for output in outputs for path in output.channels)
        self.bodies = bodies.bodies(self.system)
        turned = {name for body in self.bodies for name in body.coordinates[3:]}
        self.positions = tuple(f"{name}.q" for name in self.builder.step.coordinates)
        self.rates = tuple(f"{name}.qd" for name in self.builder.step.coordinates)
        self.turns = tuple(f"{name}.q" for name in self.builder.step.coordinates if name in turned)
        self._orientations = tuple(cell for body in self.bodies for cell in body.orientation)
        plain = tuple(name for name in self.positions if name not in self.turns)
        self.of_beds = tuple(
            f"{a.use.joint}.bed.{memory.name}" for a, bed, _ in self.system.mounted for memory in bed.memory
        )
        self._arm = (*plain, *self.rates, *self.builder.step.states, *self._orientations, *self.of_beds)

    @cached_property
    def prepared(self) -> engine.Prepared:
        """The experiment as it is run, without inputs and with its own records."""
        from met import run as engine

        return engine.prepare(self.experiment)

    @cached_property
    def ticks(self) -> int:
        """Ticks of the base rate in a period."""
        divisors = [use.divisor for use in self.system.structure.sensors]
        divisors += [use.divisor for use in guiding.ticking(self.system)]
        divisors += [actuator.use.divisor for actuator in self.system.working if actuator.ticks]
        return math.lcm(self.schedule.dynamics, *divisors)

    def begin(self, time: float) -> int:
        """The tick of the last start of a period up to a time, s. Tick 0 is excluded where the program leaves something
        out at it, as with a motor on a bed."""
        tick = math.floor(time * self.schedule.base_hz * (1.0 + 1e-12)) // self.ticks * self.ticks
        waits = any(isinstance(step, Branch) and isinstance(step.condition, Unless0) for step in self.rest)
        return self.ticks if waits and tick == 0 else tick

    @property
    def seconds(self) -> float:
        """The length of a period."""
        return self.ticks / self.schedule.base_hz

    @cached_property
    def moving(self) -> frozenset[str]:
        """The cells that move with the arm, or with a number added to an input."""
        cells = {*self._arm, *(ADDED + signal.path for signal in self.inputs)}
        sections, last = [self.recording.sections[n] for n in self._used], 0
        while len(cells) != last:
            last = len(cells)
            for section in sections:
                cells |= moved_by(section, cells)
        return frozenset(cells)

    @cached_property
    def sections(self) -> dict[int, TangentSection]:
        """The sections of the start and a tick, with tangents, by number."""
        return {n: with_tangents(self.recording.sections[n], self.moving, is_converter) for n in self._used}

    @cached_property
    def _used(self) -> tuple[int, ...]:
        return tuple(dict.fromkeys(sections_in((*self.recording.start, *self.recording.tick))))

    @cached_property
    def states(self) -> tuple[str, ...]:
        """The names of the states, those of the arm first: positions, rates and the rest. A body's orientation is named
        by its three coordinates, in place of its quaternion."""
        read, written, ever = set[str](), set[str](), set[str]()
        for k in range(1, self.ticks + 1):
            for body, tick in ((self.rest, self.ticks + k - 1), (self.finish, self.ticks + k)):
                self._look(body, tick, read, written, ever)
        own = [*self.positions, *self.rates, *self.builder.step.states]
        more = (read & ever & self.moving) - {*own, *self._orientations}
        return (*(name for name in own if name in read or name in self.turns), *sorted(more))

    @cached_property
    def remembered(self) -> frozenset[str]:
        """The cells that last from tick to tick: those that the end of a step and a period read before they write
        them."""
        read, written, ever = set[str](), set[str](), set[str]()
        self._look(self.finish, self.ticks, read, written, ever)
        for k in range(1, self.ticks + 1):
            self._look(self.rest, self.ticks + k - 1, read, written, ever)
            self._look(self.finish, self.ticks + k, read, written, ever)
        return frozenset(read & ever)

    def _look(
        self, body: Iterable[RecordedControl], tick: int, read: set[str], written: set[str], ever: set[str]
    ) -> None:
        """Add the cells that a body of control reads before it writes them, those that it writes each time, and those
        that it ever writes."""
        for step in body:
            if isinstance(step, RecordSection):
                continue
            if not isinstance(step, Branch):
                section = self.recording.sections[step.section]
                stores = {cell for cell, _ in section.stores}
                read |= {section.nodes[i][1] for i in section.order if section.nodes[i][0] == "cell"} - written
                written |= stores
                ever |= stores
            elif isinstance(step.condition, WhileAny):
                self._look(step.body, tick, read, set(written), ever)
            elif isinstance(step.condition, Unless0) or tick % step.condition.divisor == 0:
                self._look(step.body, tick, read, written, ever)

    def joint_of(self, state: str) -> str:
        """The joint that a state belongs to, or the body, or the computer on its own; in words."""
        for body in self.bodies:
            if state.startswith(f"{body.name}:"):
                return body.name
        name = state.partition(":")[2] if state.startswith(("carry:", "before:", "first:", "guide:")) else state
        return re.split("[:.]", name)[0]


def is_converter(section: CodeSection, position: int) -> bool:
    """True for a node in the part of a section where a sensor reads: rounding there is a converter's, or counting."""
    name = ""
    for begin, part in section.parts:
        if begin > position:
            break
        name = part
    return name.rpartition("/")[2] == READING
