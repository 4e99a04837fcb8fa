"""Interpretation of a recording over numpy arrays: one operation at a time, all cases of a block at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from met.backends.backend import checked_inputs
from met.frozen import frozen
from met.trace.nodes import Node, evaluate
from met.trace.program import Branch, Every, Program, RecordedControl, Recording, RecordSection, Unless0


@frozen
class Interpreter:
    """A recording that is ready to run, as a `met.backends.backend.Kernel`. lanes: largest number of cases a block."""

    recording: Recording
    lanes: int
    vector: int = 1
    cached: bool = False
    processor: str = "numpy"
    code_bytes: int = 0

    @property
    def program(self) -> Program:
        return self.recording.program

    @property
    def functions(self) -> int:
        return len(self.recording.sections)

    def run(
        self,
        inputs: np.ndarray,
        ticks: int,
        record: bool = True,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> tuple[np.ndarray | None, np.ndarray]:
        """Run all cases side by side, as `Kernel.run` of met.backends.backend: inputs [case, input] to rows [case, row,
        column] and outputs [case, output]. threads is not used."""
        program = self.program
        inputs = checked_inputs(program, inputs)
        block = InterpretedBlock(self.recording, inputs)
        rows = block.recorded(0, ticks)
        if progress is not None:
            progress(len(inputs))
        return rows if record else None, block.outputs.T.copy()

    def block(self, inputs: np.ndarray) -> InterpretedBlock:
        return InterpretedBlock(self.recording, inputs)


class InterpretedBlock:
    """Cases that are stepped together, as a `met.backends.backend.Block`."""

    def __init__(self, recording: Recording, inputs: np.ndarray) -> None:
        case_inputs = np.atleast_2d(np.asarray(inputs, dtype=np.float64))
        self.recording = recording
        self.inputs = np.ascontiguousarray(case_inputs.T)
        self.state = np.zeros((len(recording.cells), len(case_inputs)))
        self.outputs = np.zeros((len(recording.program.outputs), len(case_inputs)))
        self._cell = {name: slot for slot, name in enumerate(recording.cells)}
        self._input = {name: slot for slot, name in enumerate(recording.program.inputs)}
        self._tick = 0
        self._row: np.ndarray | None = None

    def step(self, first: int, last: int) -> None:
        self.recorded(first, last)

    def recorded(self, first: int, last: int) -> np.ndarray:
        """Run the ticks from `first` to `last`: rows [case, row, column]. Tick 0 begins with all memory 0."""
        program = self.recording.program
        divisor = program.record_divisor
        ticks = [k for k in range(first, last + 1) if k % divisor == 0]
        rows = np.empty((self.inputs.shape[1], len(ticks), program.columns))
        with np.errstate(all="ignore"):
            if first == 0:
                self.state[:] = 0.0
                self._follow(self.recording.start)
            for k in range(first, last + 1):
                self._tick = k
                self._row = rows[:, ticks.index(k)] if k % divisor == 0 else None
                self._follow(self.recording.tick)
            self._tick = last
            self._follow(self.recording.end)
        return rows

    def cells(self) -> Mapping[str, np.ndarray]:
        return {name: self.state[slot] for name, slot in self._cell.items()}

    def _follow(self, body: Iterable[RecordedControl]) -> None:
        """Run a body of control at this tick."""
        for step in body:
            if not isinstance(step, Branch):
                if not isinstance(step, RecordSection) or self._tick % step.divisor == 0:
                    self._section(step.section)
            elif isinstance(step.condition, Every):
                if self._tick % step.condition.divisor == 0:
                    self._follow(step.body)
            elif isinstance(step.condition, Unless0):
                if self._tick > 0:
                    self._follow(step.body)
            else:
                for _ in range(step.condition.at_most):
                    if not self.state[self._cell[step.condition.cell]].any():
                        break
                    self._follow(step.body)

    def _section(self, number: int) -> None:
        """Compute a section for all cases of the block, and write its cells, outputs and columns of the row."""
        section = self.recording.sections[number]
        count = self.inputs.shape[1]

        def leaf(node: Node) -> np.ndarray:
            """The values of a cell, input, tick or time in all cases, [case]."""
            if node[0] == "cell":
                return self.state[self._cell[node[1]]]
            if node[0] == "input":
                return self.inputs[self._input[node[1]]]
            tick = np.full(count, float(self._tick))
            return tick if node[0] == "tick" else tick / self.recording.program.base_hz

        values = evaluate(section.nodes, section.order, leaf, arrays=True)

        def value(ref: int) -> np.ndarray:
            return -values[ref >> 1] if ref & 1 else values[ref >> 1]

        stores = [(self._cell[name], value(ref)) for name, ref in section.stores]
        records = [(column, value(ref)) for column, ref in section.records]
        for slot, ref in section.outputs:
            self.outputs[slot] = value(ref)
        # all values are taken before the first store: a cell may be given the former value of another
        for slot, stored in [(slot, np.array(stored)) for slot, stored in stores]:
            self.state[slot] = stored
        for column, recorded in records:
            assert self._row is not None
            self._row[:, column] = recorded
