"""A program in C, compiled here and called: each block is a library of its own, since its memory is static."""

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
from met.trace.program import Program
from met.trace.recording import Recording

FLAGS = ("-std=c11", "-O1", "-ffp-contract=off", "-fPIC", "-shared")

_ENTRIES = """
void met_give(const double *inputs) {{ {inputs} }}
void met_begin(void) {{ met_start(); }}
void met_advance(int64_t k) {{ met_tick(k); }}
void met_finish(void) {{ met_end(); }}
void met_take(double *outputs) {{ {outputs} }}
double *met_row(void) {{ return {row}; }}
double *met_cells(void) {{ return {cells}; }}
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
        self.object = _compiled(recording)
        self.code_bytes = len(self.object)
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
        program = self.program
        inputs = checked_inputs(program, inputs)
        rows = np.empty((len(inputs), ticks // program.record_divisor + 1, program.columns)) if record else None
        outputs = np.empty((len(inputs), len(program.outputs)))
        block = CBlock(self, np.zeros((1, len(program.inputs))))
        for case, given in enumerate(inputs):
            block.inputs[:, 0] = given
            found = block.recorded(0, ticks)
            if rows is not None:
                rows[case] = found[0]
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
        with tempfile.TemporaryDirectory() as folder:  # a loaded library stays when its file is gone
            path = Path(folder) / "program.so"
            path.write_bytes(library.object)
            self._called = ctypes.CDLL(str(path))
        self._names = library.recording.cells
        self.state = self._numbers("met_cells", len(self._names)).reshape(-1, 1)
        self._row = self._numbers("met_row", program.columns)

    def _numbers(self, entry: str, count: int) -> np.ndarray:
        """A view of the doubles that a function of the library points to."""
        if not count:
            return np.empty(0)
        function = getattr(self._called, entry)
        function.restype = ctypes.POINTER(ctypes.c_double)
        return np.ctypeslib.as_array(function(), (count,))

    def step(self, first: int, last: int) -> None:
        self.recorded(first, last)

    def recorded(self, first: int, last: int) -> np.ndarray:
        rows = []
        self._called.met_give(self.inputs.ctypes.data_as(ctypes.c_void_p))
        if first == 0:
            self._called.met_begin()
        for k in range(first, last + 1):
            self._called.met_advance(ctypes.c_int64(k))
            if k % self.program.record_divisor == 0:
                rows.append(self._row.copy())
        self._called.met_finish()
        self._called.met_take(self.outputs.ctypes.data_as(ctypes.c_void_p))
        return np.array(rows).reshape(1, len(rows), self.program.columns)

    def cells(self) -> Mapping[str, np.ndarray]:
        return {name: self.state[slot] for slot, name in enumerate(self._names)}


def _compiled(recording: Recording) -> bytes:
    """The shared library of a program."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise RuntimeError("there is no C compiler `cc` here")
    source = emit(recording)
    program = recording.program
    text = source.text + _ENTRIES.format(
        inputs=" ".join(f"{source.inputs[name]} = inputs[{n}];" for n, name in enumerate(program.inputs)),
        outputs=" ".join(f"outputs[{n}] = {source.outputs[name]};" for n, name in enumerate(program.outputs)),
        row="met.row" if program.columns else "0",
        cells=f"&{source.cells[recording.cells[0]]}" if recording.cells else "0",  # neighbours in the struct
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / "program.c").write_text(text, encoding="utf-8")
        command = [compiler, *FLAGS, "-o", str(path / "program.so"), str(path / "program.c")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"`cc` refuses the program:\n{done.stderr}")
        return (path / "program.so").read_bytes()
