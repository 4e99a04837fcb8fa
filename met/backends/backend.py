"""Protocols of a back end (`Backend`) and of the kernels that it makes of a recorded program (`Kernel`, `Block`).

Four implement it: `LlvmKernel` and `LlvmBlock`, `Library` and `CBlock` in C, `WasmKernel` and `WasmBlock`,
`Interpreter` and `InterpretedBlock`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from met.trace.program import Program, Recording


class Block(Protocol):
    """A few cases whose state stays from call to call: a motor bed's loop, a debugger.

    inputs   [input, lane], to be changed at will between steps
    outputs  [output, lane], as of the last step
    state    [cell, lane], in the order of `Recording.cells`, to be read or changed
    """

    inputs: np.ndarray
    outputs: np.ndarray
    state: np.ndarray

    def step(self, first: int, last: int) -> None:
        """Run ticks first to last, both included, then `end`. Tick 0 starts afresh."""

    def recorded(self, first: int, last: int) -> np.ndarray:
        """Run these ticks as `step` does; returns the rows [case, row, column] of those ticks."""

    def cells(self) -> Mapping[str, np.ndarray]:
        """The state by name, [lane] each: views. Cells that nothing reads are not kept."""


class Kernel(Protocol):
    """A program that is ready to run many cases."""

    @property
    def recording(self) -> Recording:
        """The recording that the kernel was made of."""

    @property
    def program(self) -> Program:
        """The program of the recording."""

    @property
    def lanes(self) -> int:
        """Number of cases of a block."""

    @property
    def vector(self) -> int:
        """Number of cases that one register holds."""

    @property
    def cached(self) -> bool:
        """True where the kernel was in the cache, rather than compiled now."""

    @property
    def processor(self) -> str:
        """The processor that the kernel is for."""

    @property
    def code_bytes(self) -> int:
        """Size of the code in bytes."""

    @property
    def functions(self) -> int:
        """Number of functions of the code."""

    def run(
        self,
        inputs: np.ndarray,
        ticks: int,
        record: bool = True,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> tuple[np.ndarray | None, np.ndarray]:
        """Run cases from tick 0 to tick `ticks`, both included.

        inputs    [case, input], in the order of `program.inputs`
        threads   None: as many as this process may use
        progress  called with the number of cases done so far, from the thread that called
        Returns rows [case, row, column], or None without `record`, and outputs [case, output].
        """

    def block(self, inputs: np.ndarray) -> Block:
        """A block of at most `lanes` cases to step one call at a time. inputs: [case, input]."""


def checked_inputs(program: Program, inputs: np.ndarray) -> np.ndarray:
    """The inputs of cases as a kernel takes them: [case, input], contiguous float64. Raises ValueError."""
    inputs = np.ascontiguousarray(inputs, dtype=np.float64)
    if inputs.ndim != 2 or inputs.shape[1] != len(program.inputs):
        raise ValueError(f"inputs of shape {inputs.shape} for a program with {len(program.inputs)} inputs")
    return inputs


class Backend(Protocol):
    """A back end."""

    @property
    def name(self) -> str:
        """The name by which it is chosen."""

    @property
    def version(self) -> int:
        """Version of its lowering, part of every code key: it is raised when the bits that a recording gives change."""

    def emit(self, recording: Recording) -> str:
        """The program as text, as `load` would compile it here; for people, and for `met dump kernel`."""

    def load(self, recording: Recording, *, lanes: int | None = None, inline: bool = True) -> Kernel:
        """The program, ready to run. inline: False where the time of each section alone is measured."""

    def libraries(self) -> Mapping[str, str]:
        """Versions, by name, of the libraries that affect the computed bits, as archives record them."""
