"""The memory of one case carried through a period with its tangents, and the events at which there are no tangents."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from met.analysis.linear.period import ADDED, PeriodProgram
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.program.cells import AT_LIMIT, FRICTION_MODE, HAS_FRICTION, NamedValues, answer
from met.program.friction import Sticking
from met.program.system import Actuator
from met.servos.servo import JointMotion
from met.trace.nodes import Node, live
from met.trace.program import Branch, Every, RecordedControl, RecordSection, Unless0
from met.trace.tangents import HEAD, Kink, TangentSection, values

HANDS_OVER = {"grappling": "grappled", "releasing": "released"}
"""The words for loops in which payloads change hands, by the cell that counts them."""


MOST_CELLS = 3
"""Largest number of compared cells that a message names; with more, it names the phase."""


@frozen
class Edge:
    """A kink on which the memory stands.

    run    the section's number in the order of the period;  nodes: of the kink;  phase: the section's name
    tick   of the base rate;  cells: those that move what is compared
    """

    run: int
    nodes: tuple[int, ...]
    phase: str
    tick: int
    cells: tuple[str, ...]

    @property
    def subject(self) -> str:
        """The subject of a message: the part that is exactly on the kink."""
        if 0 < len(self.cells) <= MOST_CELLS:
            return listed(list(self.cells))
        return f"a number of `{self.phase}`"


class Flow:
    """The memory of a case under way, cells by name: numbers, and tangents of those that move, [direction]."""

    shape: tuple[int, ...] = ()
    """The shape of the cases, before the dimension of a tangent."""

    def __init__(
        self, program: PeriodProgram, inputs: Mapping[str, float], cells: Mapping[str, float], tick: int
    ) -> None:
        """cells: at the end of tick `tick`."""
        self.program, self.inputs, self.tick = program, inputs, tick
        self.cells: dict[str, float] = dict(cells)
        self.tangents: dict[str, np.ndarray] = {}
        self.rows: dict[int, Any] = {}
        self.row_tangents: dict[int, np.ndarray] = {}
        self.edges: list[Edge] = []
        self.opposite: Mapping[int, Any] = {}
        self._recording, self._runs = False, 0

    def copy(self, *, tangents: bool = True) -> Flow:
        flow = Flow(self.program, self.inputs, self.cells, self.tick)
        flow.tangents = dict(self.tangents) if tangents else {}
        return flow

    def begin(self) -> None:
        """Run the start, up to the instant 0, at which nothing has ticked yet."""
        self._follow(self.program.recording.start)

    def finish(self) -> None:
        """Finish the step that ends at the next tick."""
        self.tick += 1
        self._follow(self.program.finish)

    def ticks(self, *, recording: bool = False) -> None:
        """Run everything at this tick once the step is finished. recording: whether its columns are kept."""
        self._recording = recording
        self._follow(self.program.rest)
        self._recording = False

    def period(self) -> None:
        """Run all ticks and steps of a period."""
        for _ in range(self.program.ticks):
            self.ticks()
            self.finish()

    def locked(self) -> tuple[str, ...]:
        """Joints at rest that a servo without a law keeps there for the whole period that begins here, whatever the arm
        does, as `locked` does until its release."""
        system, begin = self.program.system, self.tick / self.program.schedule.base_hz
        return tuple(
            actuator.use.joint
            for actuator in system.working
            if actuator.servo.at_rest is not None
            and actuator.servo.control is None
            and self.cells[f"{actuator.use.joint}.qd"] == 0.0
            and all(self._is_kept(actuator, time) for time in (begin, begin + self.program.seconds))
        )

    def _is_kept(self, actuator: Actuator, time: float) -> bool:
        """True where a servo gives its joint no acceleration in a step that begins at a time, s."""
        p, none = self.program.system.servo_values(actuator, self.cells.__getitem__), NamedValues(actuator.owner, {})
        q, qd = (self.cells[f"{actuator.use.joint}.{part}"] for part in ("q", "qd"))
        joint = JointMotion(q, qd, time, time, actuator.command_kind)
        drive = answer(actuator.owner, actuator.servo.drive, p, none, none, joint)
        return bool(drive.given) and float(drive.qdd) == 0.0

    def tangent(self, name: str) -> Any:
        """The tangent of a cell, [direction]; 0 for a cell that does not move."""
        return self.tangents.get(name, 0.0)

    def run(self, number: int) -> None:
        """Run one section of the program for this case, with tangents, and note its kinks. number: of the section"""
        section, moves = self.program.sections[number], bool(self.tangents)
        with np.errstate(all="ignore"):
            value_of = values(section, self._leaf, self.opposite.get(self._runs, frozenset()), plain=not moves)
        cells = [(cell, float(value_of(ref))) for cell, ref in section.stores]
        tangents = [(cell, value_of(ref)) for cell, ref in section.tangents] if moves else []
        if moves:
            for kink in section.kinks:
                a, b = kink.sides
                if value_of(a) == value_of(b) and np.any(value_of(kink.move) != 0.0):
                    self.edges.append(Edge(self._runs, kink.nodes, section.name, self.tick, self._moved(section, kink)))
        self._store(section, value_of, cells, tangents)
        self._runs += 1

    def _store(
        self,
        section: TangentSection,
        value_of: Callable[[int], Any],
        cells: Iterable[tuple[str, Any]],
        tangents: Iterable[tuple[str, Any]],
    ) -> None:
        """Store the results of a section. value_of: the value of a reference; cells, tangents: of its stores"""
        moves = bool(self.tangents)
        for cell, value in cells:
            self.cells[cell] = value
            self.tangents.pop(cell, None)
        self.tangents.update({cell: move for cell, move in tangents if np.any(move != 0.0)})
        if self._recording and moves:
            self.rows.update({column: value_of(ref) for column, ref in section.records})
            self.row_tangents.update({column: value_of(ref) for column, ref in section.record_tangents})

    def _moved(self, section: TangentSection, kink: Kink) -> tuple[str, ...]:
        """The moving cells that a kink compares."""
        nodes = (section.nodes[i] for i in live(section.nodes, kink.sides))
        return tuple(node[1] for node in nodes if node[0] == "cell" and node[1] in self.tangents)

    def _leaf(self, node: Node) -> Any:
        """The value of a cell, input, tick or time in this memory."""
        kind, *rest = node
        if kind == "cell":
            name = rest[0]
            return self.tangents.get(name[len(HEAD) :], 0.0) if name.startswith(HEAD) else self.cells.get(name, 0.0)
        if kind == "input":
            return self.inputs[rest[0]]
        return float(self.tick) if kind == "tick" else self.tick / self.program.schedule.base_hz

    def _follow(self, body: Iterable[RecordedControl]) -> None:
        """Run the sections and branches of a body of the program for this case."""
        for step in body:
            if not isinstance(step, Branch):
                if not isinstance(step, RecordSection) or self._recording:
                    self.run(step.section)
            elif isinstance(step.condition, Every):
                if self.tick % step.condition.divisor == 0:
                    self._follow(step.body)
            elif isinstance(step.condition, Unless0):
                if self.tick > 0:
                    self._follow(step.body)
            else:
                self._loop(step)

    def _loop(self, step: Branch) -> None:
        """Run a loop of the program until its condition cell is 0. Raises Problem where an event is on the way, at
        which there is no derivative: a joint comes to rest, or a payload is handed over."""
        condition: Any = step.condition
        for _ in range(condition.at_most):
            if self.cells.get(condition.cell, 0.0) == 0.0:
                break
            before = self.modes()
            self._follow(step.body)
            if self.tangents and condition.cell == "crossing":
                names = [name for name, mode in before.items() if mode != 0.0 and self._rate(name) == 0.0]
                raise self.event(f"{listed(names)} {'come' if len(names) > 1 else 'comes'} to rest")
            if self.tangents and condition.cell in HANDS_OVER:
                raise self.event(f"a payload is {HANDS_OVER[condition.cell]}")

    def modes(self) -> dict[str, float]:
        """Modes of everything with dry friction in this case, by the name of a joint or a servo's state: 0 sticks."""
        sticking = self.program.builder.step.sticking
        return {part.name: self.mode(part) for part in sticking if part.level is not None or self.rubs(part) != 0.0}

    def rubs(self, sticking: Sticking) -> float:
        """A number other than 0 where a joint or a servo's state, whose friction is a parameter, has dry friction in
        this case."""
        return self.cells.get(HAS_FRICTION(sticking.name), 0.0)

    def mode(self, sticking: Sticking) -> float:
        """The friction mode of a joint or a servo's state: 0 sticks."""
        return self.cells.get(FRICTION_MODE(sticking.name), 0.0)

    def _rate(self, name: str) -> float:
        return next(
            self.cells[sticking.cell] for sticking in self.program.builder.step.sticking if sticking.name == name
        )

    def breaking_away(self) -> list[str]:
        """Joints at rest with dry friction that begin to slide."""
        return [name for name, mode in self.modes().items() if mode != 0.0 and self._rate(name) == 0.0]

    def limits(self) -> dict[str, float]:
        """Steps that began at each limit so far, by its path: limits of motors and of loads on the arm. Limits of a
        joint have no effect, and a command reaches its own by time alone."""
        uses = [use for use in self.program.builder.limits.uses if use.channels or use.owner]
        return {use.path: self.cells.get(AT_LIMIT(use.path), 0.0) for use in uses}

    def refuse(self, truth: Any, what: Callable[[], str]) -> None:
        """Raise the Problem of an event where this is true. what: gives the event, in words"""
        if truth:
            raise self.event(what())

    def event(self, what: str, tick: int | None = None) -> Problem:
        """The refusal of a derivative across an event, at a tick, or where the memory stands."""
        experiment = self.program.experiment
        time = (self.tick if tick is None else tick) / self.program.schedule.base_hz
        return Problem(
            error(
                "D370",
                f"`{experiment.name}` has no derivative here: {what}, t = {time:.6g} s",
                experiment.place,
                help=(
                    "a derivative describes small changes, and across an event no change is small",
                    "ask at another instant, `--at`, from which nothing changes for a period of the computers, "
                    f"{self.program.seconds:g} s",
                ),
            )
        )


def listed(names: list[str]) -> str:
    """Names as a message has them."""
    return ", ".join(f"`{name}`" for name in names) or "what slides"


def added(path: str) -> str:
    """The cell that is added to an input."""
    return ADDED + path


def derive(flow: Flow) -> None:
    """Compute the slopes of the arm where a flow stands."""
    (number,) = (k for k, section in enumerate(flow.program.recording.sections) if section.name == "derive")
    flow.run(number)
