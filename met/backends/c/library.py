"""A program in C, compiled here and called."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from met.backends.backend import checked_inputs
from met.backends.c.emit import emit
from met.trace.program import Program, Recording

FLAGS = ("-std=c11", "-O1", "-ffp-contract=off", "-fPIC", "-shared")

_ENTRIES = """
#include <stddef.h>
size_t met_size(void) {{ return sizeof(met_case); }}
size_t met_row(void) {{ return {row}; }}
size_t met_cells(void) {{ return {cells}; }}
void met_give(met_case *met, const double *inputs) {{ (void)met; (void)inputs; {inputs} }}
void met_begin(met_case *met) {{ met_start(met); }}
void met_advance(met_case *met, int64_t k) {{ met_tick(met, k); }}
void met_finish(met_case *met) {{ met_end(met); }}
void met_take(const met_case *met, double *outputs) {{ (void)met; (void)outputs; {outputs} }}
"""


class Library:
    """A recording that is ready to run, one case at a time, as a `met.backends.backend.Kernel`.

    Raises RuntimeError where there is no `cc`, or it fails.
    """

    lanes = 1
    vector = 1
    cached = False
    processor = "cc"

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.called, self.code_bytes = _compiled(recording)
        self.functions = len(recording.sections)

    @property
    def program(self) -> Program:
        return self.recording.program

    def run(
        self,
        inputs: np.ndarray,
        ticks: int,
        record: bool = True,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> tuple[np.ndarray | None, np.ndarray]:
        """Run cases one after another, as `Kernel.run` of met.backends.backend: inputs [case, input] to rows [case,
        row, column] and outputs [case, output]."""
        program = self.program
        inputs = checked_inputs(program, inputs)
        rows = np.empty((len(inputs), ticks // program.record_divisor + 1, program.columns)) if record else None
        outputs = np.empty((len(inputs), len(program.outputs)))
        block = CBlock(self, np.zeros((1, len(program.inputs))))
        for case, case_inputs in enumerate(inputs):
            block.inputs[:, 0] = case_inputs
            recorded = block.recorded(0, ticks)
            if rows is not None:
                rows[case] = recorded[0]
            outputs[case] = block.outputs[:, 0]
            if progress is not None:
                progress(case + 1)
        return rows, outputs

    def block(self, inputs: np.ndarray) -> CBlock:
        return CBlock(self, inputs)


class CBlock:
    """One case that is stepped call by call, as a `met.backends.backend.Block`."""

    def __init__(self, library: Library, inputs: np.ndarray) -> None:
        program = library.program
        self.program = program
        self.inputs = np.ascontiguousarray(np.atleast_2d(np.asarray(inputs, dtype=np.float64)).T)
        self.outputs = np.zeros((len(program.outputs), 1))
        self._called = library.called
        self._memory = np.zeros(self._called.met_size() // 8)
        self._case = self._memory.ctypes.data_as(ctypes.c_void_p)
        self._names = library.recording.cells
        self.state = self._numbers(self._called.met_cells(), len(self._names)).reshape(-1, 1)
        self._row = self._numbers(self._called.met_row(), program.columns)

    def _numbers(self, offset: int, count: int) -> np.ndarray:
        """A view of doubles of the case's struct, from this offset in bytes on."""
        return self._memory[offset // 8 : offset // 8 + count]

    def step(self, first: int, last: int) -> None:
        self.recorded(first, last)

    def recorded(self, first: int, last: int) -> np.ndarray:
        """Run the ticks from `first` to `last` of the one case: rows [1, row, column]. Tick 0 begins anew."""
        rows = []
        self._called.met_give(self._case, self.inputs.ctypes.data_as(ctypes.c_void_p))
        if first == 0:
            self._called.met_begin(self._case)
        for k in range(first, last + 1):
            self._called.met_advance(self._case, ctypes.c_int64(k))
            if k % self.program.record_divisor == 0:
                rows.append(self._row.copy())
        self._called.met_finish(self._case)
        self._called.met_take(self._case, self.outputs.ctypes.data_as(ctypes.c_void_p))
        return np.array(rows).reshape(1, len(rows), self.program.columns)

    def cells(self) -> Mapping[str, np.ndarray]:
        return {name: self.state[slot] for slot, name in enumerate(self._names)}


def _compiled(recording: Recording) -> tuple[ctypes.CDLL, int]:
    """The shared library of a program, loaded, and its size in bytes."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise RuntimeError("there is no C compiler `cc` here")
    source = emit(recording)
    program = recording.program
    text = source.text + _ENTRIES.format(
        inputs=" ".join(f"met->{source.inputs[name]} = inputs[{n}];" for n, name in enumerate(program.inputs)),
        outputs=" ".join(f"outputs[{n}] = met->{source.outputs[name]};" for n, name in enumerate(program.outputs)),
        row="offsetof(met_case, row)" if program.columns else "0",
        cells=f"offsetof(met_case, {source.cells[recording.cells[0]]})" if recording.cells else "0",  # neighbours there
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / "program.c").write_text(text, encoding="utf-8")
        command = [compiler, *FLAGS, "-o", str(path / "program.so"), str(path / "program.c")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"`cc` refuses the program:\n{done.stderr}")
        # A loaded library stays when its file is gone.
        return ctypes.CDLL(str(path / "program.so")), (path / "program.so").stat().st_size
