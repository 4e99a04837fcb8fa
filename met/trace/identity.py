"""Keys of the computations of a recorded program, independent of the names of its cells, sections and inputs.

A program is written down with its names taken away: live operations by position, cells and sections by number in the
order in which control comes to them, inputs and outputs by their places. The SHA-256 of that text is the key. So a
renamed cell, a reworded docstring or another layout of the emitted code leaves it alone, and another constant or
another order of rounding does not.

The state is everything that the program's `state_outputs` depend on. It has one key; each of the other results (an
output, or some columns of a row) has its own, of its computation beyond the state. Equal keys of the state, and equal
inputs, give equal bits of the state; equal keys of a result besides give equal bits of it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from met.trace.nodes import OPERANDS, live
from met.trace.program import (
    Branch,
    CodeSection,
    RecordedControl,
    Recording,
    RecordSection,
    WhileAny,
    cells_behind,
    slice_roots,
)


def state_key(recording: Recording) -> str:
    """The key of everything that decides the program's state: 64 hexadecimal digits."""
    return _state_writer(recording).key()


def result_keys(recording: Recording, results: Mapping[str, Collection[int] | str]) -> dict[str, str]:
    """The keys of results by name. A result is an output, by its name, or columns of a row, by their numbers."""
    state = _state_writer(recording)
    state.key()
    keys = {}
    for name, wanted in results.items():
        if isinstance(wanted, str):
            writer = _Writer(recording, {recording.program.outputs.index(wanted): 0}, state=state.cells)
        else:
            writer = _Writer(recording, {}, {column: place for place, column in enumerate(wanted)}, state.cells)
        keys[name] = writer.key()
    return keys


def _state_writer(recording: Recording) -> _Writer:
    program = recording.program
    names = program.outputs if program.state_outputs is None else program.state_outputs
    return _Writer(recording, {program.outputs.index(name): place for place, name in enumerate(names)})


class _Writer:
    """Writer of the part of a program on which some outputs, or columns of a row, depend.

    outputs, columns  what is asked for, and the place that each is written down under
    state             cells that are known already, by name, with their numbers: what they hold is not gone into
    """

    def __init__(
        self,
        recording: Recording,
        outputs: Mapping[int, int],
        columns: Mapping[int, int] | None = None,
        state: Mapping[str, int] | None = None,
    ) -> None:
        self.recording = recording
        self.outputs = outputs
        self.columns = columns or {}
        self.state = state or {}
        self.inputs = {name: place for place, name in enumerate(recording.program.inputs)}
        self.cells: dict[str, int] = {}
        self.sections: dict[int, int] = {}
        self.lines: list[str] = []
        body = (*recording.start, *recording.tick, *recording.end)
        self.needed = cells_behind(recording.sections, body, self.outputs, self.columns, known=frozenset(self.state))

    def key(self) -> str:
        """The SHA-256 of the text."""
        program = self.recording.program
        self._put("rate", program.base_hz.hex())
        for part in (self.recording.start, self.recording.tick, self.recording.end):
            self._put("control", self._control(part))
        return hashlib.sha256("\n".join(self.lines).encode()).hexdigest()

    def _put(self, *words: Any) -> None:
        self.lines.append(" ".join(map(str, words)))

    def _control(self, body: Iterable[RecordedControl]) -> list[Any]:
        """The part of a program's control on which the results depend: its sections and branches by number."""
        needed: list[Any] = []
        for step in body:
            if isinstance(step, Branch):
                inner = self._control(step.body)
                if inner:
                    needed.append([*self._condition(step.condition), inner])
                continue
            section = self._section(step.section)
            if section is not None:
                needed.append(["row", step.divisor, section] if isinstance(step, RecordSection) else section)
        return needed

    def _condition(self, condition: Any) -> list[Any]:
        if isinstance(condition, WhileAny):
            return ["while", self._cell(condition.cell), condition.at_most]
        return [type(condition).__name__.lower(), *([condition.divisor] if hasattr(condition, "divisor") else [])]

    def _cell(self, name: str) -> str:
        """The name of a cell: for a cell of the state by the state's number, for any other by the writer's."""
        known = self.state.get(name)
        return f"state{known}" if known is not None else f"cell{self.cells.setdefault(name, len(self.cells))}"

    def _section(self, number: int) -> int | None:
        """The number under which a section is written down; None where nothing of it is needed."""
        section = self.recording.sections[number]
        if number not in self.sections:
            if not slice_roots(section, self.needed, self.outputs, self.columns):
                return None
            self.sections[number] = len(self.sections)
            self._write(section, self.sections[number])
        return self.sections[number]

    def _write(self, section: CodeSection, number: int) -> None:
        """Write what a section computes of the needed cells, outputs and columns, numbered afresh."""
        order = live(section.nodes, slice_roots(section, self.needed, self.outputs, self.columns))
        place = {i: 2 * n for n, i in enumerate(order)}
        self._put("section", number)
        for i in order:
            node = section.nodes[i]
            count = OPERANDS[node[0]]
            operands = (place[ref >> 1] | ref & 1 for ref in node[1 : 1 + count])
            self._put(node[0], *operands, *(self._written(node[0], rest) for rest in node[1 + count :]))
        for cell, ref in section.stores:
            if cell in self.needed:
                self._put("store", self._cell(cell), place[ref >> 1] | ref & 1)
        for kind, places, roots in (
            ("output", self.outputs, section.outputs),
            ("column", self.columns, section.records),
        ):
            for number, ref in roots:
                if number in places:
                    self._put(kind, places[number], place[ref >> 1] | ref & 1)

    def _written(self, op: str, rest: Any) -> str:
        """Text of a node's further arguments: a number, a table, a bit's number, or the name of a cell or input."""
        if op == "cell":
            return self._cell(rest)
        if op == "input":
            return str(self.inputs[rest])
        if isinstance(rest, tuple):
            return ",".join(float(x).hex() for x in rest)
        return rest.hex() if isinstance(rest, float) else str(rest)
