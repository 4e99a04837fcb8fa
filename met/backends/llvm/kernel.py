"""A program as machine code that runs many cases at once: compile, cache, run, step.

A block is as many cases as a vector has lanes; it runs from the first tick to the last while its memory stays in the
processor's nearest cache. Threads take chunks of blocks. A case's bits depend on the case and on the program alone:
not on lanes, threads, chunk, neighbours or, given fused multiply-add, on the machine.
"""

from __future__ import annotations

import ctypes
import math
import os
import threading
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from typing import TYPE_CHECKING, Any

import numpy as np

from met.backends.backend import checked_inputs
from met.backends.llvm.emit import emit, numbered
from met.backends.llvm.pieces import cut, operations
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host import cache, system
from met.trace.program import Program, Recording
from met.trace.recorder import record

if TYPE_CHECKING:
    from met.backends.llvm.machine import Machine

# live operations of the largest section up to which a block is four registers wide, two of them side by side in each
# piece of code: the shorter the code, the more of it fits into registers and is in flight at once
_SMALL = 400
# blocks, and blocks times ticks, that one call into machine code runs at most: calls cannot be interrupted, and
# progress is told between them; a tenth of a second or so
_CHUNK, _CALL = 256, 1 << 16
# s between two tidings of progress while several threads are at work
_TELLING_SECONDS = 0.2

_SIGNATURE = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4, *[ctypes.c_int64] * 6)


def compile(
    program: Program, lanes: int | None = None, cpu: str | None = None, *, level: int | None = None
) -> LlvmKernel:
    """Compile a program to machine code.

    lanes   cases a block: 2, 4, 8, 16 or 32; by default what is fastest here. Decides nothing but speed.
    cpu     one of LLVM's names of processors; the one we run on by default
    level   of LLVM's optimisation, 0 to 3; None: its code generator alone (met.backends.llvm.machine.assemble)
    """
    recording = record(program)
    return from_recording(recording, lanes, cpu, level=level)


def from_recording(
    recording: Recording,
    lanes: int | None = None,
    cpu: str | None = None,
    *,
    level: int | None = None,
    inline: bool = True,
) -> LlvmKernel:
    """Compile a recorded program to machine code. inline: as in `met.backends.llvm.emit.emit`."""
    from met.backends.llvm import machine as llvm

    machine = llvm.machine(cpu)
    if not machine.fma:
        _refuse_or_warn(machine)
    lanes, text = written(recording, machine, lanes, inline=inline)
    name = cache.key(numbered(text), llvm.versions(), machine.cpu, machine.features, str(level))
    code, hit = cache.cached(name, lambda: llvm.assemble(text, machine, level=level))
    return LlvmKernel(recording, lanes, machine, llvm.Loaded(code, machine), hit)


def written(
    recording: Recording, machine: Machine, lanes: int | None = None, *, inline: bool = True
) -> tuple[int, str]:
    """The number of cases a block, chosen where none is given, and the IR: several registers' worth of cases, which
    hide each other's latency."""
    largest = max((len(operations(section)) for section in recording.sections), default=0)
    small = largest <= _SMALL
    if lanes is None:
        lanes = machine.width * (4 if small else 2)
    if lanes not in (2, 4, 8, 16, 32):
        raise ValueError(f"{lanes} lanes")
    vector = min(lanes, machine.width * (2 if small else 1))
    return lanes, emit(recording, lanes, vector=vector, width=machine.width, inline=inline)


def _refuse_or_warn(machine: Machine) -> None:
    """Raise Problem E210 on a processor without fused multiply-add; with MET_ALLOW_NO_FMA=1 warn that it is slow."""
    if os.environ.get("MET_ALLOW_NO_FMA") != "1":
        raise Problem(
            error(
                "E210",
                f"this processor ({machine.cpu}) has no fused multiply-add, which results depend on to the bit",
                help=(
                    "run on a processor with FMA (Intel since 2013, AMD since 2012, every arm64)",
                    "MET_ALLOW_NO_FMA=1 computes the same bits here, many times slower",
                ),
            )
        )
    warnings.warn(
        f"{machine.cpu} has no fused multiply-add: each is computed by software, many times slower", stacklevel=4
    )


@frozen
class LlvmKernel:
    """Machine code of a program. `cached` is True where it was loaded from the cache."""

    recording: Recording
    lanes: int
    machine: Machine
    loaded: Any
    cached: bool

    @property
    def program(self) -> Program:
        """The program of the recording."""
        return self.recording.program

    @property
    def vector(self) -> int:
        """The number of cases in a register."""
        return min(self.lanes, self.machine.width)

    @property
    def processor(self) -> str:
        """LLVM's name of the processor that the code was compiled for."""
        return self.machine.cpu

    @property
    def code_bytes(self) -> int:
        """The number of bytes of instructions."""
        from met.backends.llvm import machine

        return machine.size(self.loaded.code)

    @property
    def functions(self) -> int:
        """The number of functions into which the sections were compiled."""
        return sum(len(cut(section)) for section in self.recording.sections)

    @property
    def entry(self) -> Callable[..., None]:
        """The address of the entry function (its arguments are in met/backends/llvm/entry.py); it runs without Python's
        lock."""
        return _SIGNATURE(self.loaded.address)

    def rows(self, first: int, last: int) -> int:
        """Number of rows recorded by ticks first to last, both included."""
        divisor = self.program.record_divisor
        return last // divisor - (first + divisor - 1) // divisor + 1

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
        progress  told how many cases are done, from the thread that called, again and again while a case takes long;
                  what it raises ends them all
        Returns rows [case, row, column], or None without `record`, and outputs [case, output].
        """
        program = self.program
        inputs = checked_inputs(program, inputs)
        if ticks < 0:
            raise ValueError(f"{ticks} ticks")
        cases = len(inputs)
        rows = np.empty((cases, self.rows(0, ticks), program.columns)) if record else None
        outputs = np.empty((cases, len(program.outputs)))
        threads = system.cores() if threads is None else max(1, threads)
        blocks = -(-cases // self.lanes)
        chunk = self.lanes * max(1, min(_CHUNK, _CALL // (ticks + 1), -(-blocks // (8 * threads))))
        starts = range(0, cases, chunk)
        ended = threading.Event()

        done = 0

        def tell() -> None:
            if progress is not None:
                progress(done)

        def work(start: int, between: Callable[[], None] = lambda: None) -> int:
            """Run the chunk of cases from `start` on in this thread; returns their number."""
            stop = min(start + chunk, cases)
            own_rows = None if rows is None else rows[start:stop]
            self._run_chunk(inputs[start:stop], ticks, own_rows, outputs[start:stop], ended, between)
            return stop - start

        if threads == 1 or len(starts) <= 1:
            for start in starts:
                done += work(start, tell)
                tell()
            return rows, outputs
        with ThreadPoolExecutor(threads) as pool:
            waiting = {pool.submit(work, start) for start in starts}
            try:
                while waiting:
                    finished, waiting = wait(waiting, _TELLING_SECONDS, return_when=FIRST_COMPLETED)
                    done += sum(future.result() for future in finished)
                    tell()
            except BaseException:
                ended.set()
                pool.shutdown(wait=False, cancel_futures=True)
                raise
        return rows, outputs

    def _run_chunk(
        self,
        inputs: np.ndarray,
        ticks: int,
        rows: np.ndarray | None,
        outputs: np.ndarray,
        ended: threading.Event,
        between: Callable[[], None],
    ) -> None:
        """Run some cases in this thread; all blocks use one state in turn. A long run of a single block is cut into
        stretches; after each, `between` is called, and the run stops if all cases have ended."""
        cases, lanes = len(inputs), self.lanes
        blocks = -(-cases // lanes)
        packed = _aligned((blocks, inputs.shape[1], lanes))
        _pack(inputs, packed)
        state = _aligned((max(1, len(self.recording.cells)), lanes))
        results = _aligned((blocks, max(1, outputs.shape[1]), lanes))
        record = rows is not None and rows.shape[2] > 0
        stretch = _CALL if blocks == 1 else ticks + 1
        for first in range(0, ticks + 1, stretch):
            if ended.is_set():
                return
            if first:
                between()
            pointer = None
            if record and rows is not None:
                pointer = rows.ctypes.data + self.rows(0, first - 1) * rows.strides[1] if first else rows.ctypes.data
            self.entry(
                packed.ctypes.data,
                state.ctypes.data,
                pointer,
                results.ctypes.data,
                blocks,
                first,
                min(first + stretch - 1, ticks),
                cases,
                rows.strides[0] // 8 if rows is not None else 0,
                0,
            )
        width = outputs.shape[1]
        flat = results.reshape(-1)[: blocks * width * lanes].reshape(blocks, width, lanes)
        outputs[:] = flat.transpose(0, 2, 1).reshape(blocks * lanes, width)[:cases]

    def block(self, inputs: np.ndarray) -> LlvmBlock:
        """A block whose state persists from call to call. inputs: [case, input], at most `lanes` cases."""
        return LlvmBlock(self, inputs)


class LlvmBlock:
    """Up to `lanes` cases, stepped call by call, for a bed's loop or a debugger.

    inputs    [input, lane], to be changed at will between steps
    outputs   [output, lane], as of the last step
    """

    def __init__(self, kernel: LlvmKernel, inputs: np.ndarray | Sequence[Sequence[float]]) -> None:
        """inputs: [case, input], as many cases as the kernel has lanes, or fewer. Raises ValueError for another
        shape."""
        case_inputs = np.atleast_2d(np.asarray(inputs, dtype=np.float64))
        program = kernel.program
        if not 1 <= len(case_inputs) <= kernel.lanes or case_inputs.shape[1] != len(program.inputs):
            raise ValueError(
                f"inputs of shape {case_inputs.shape} for {kernel.lanes} lanes, {len(program.inputs)} inputs"
            )
        self.kernel = kernel
        self.cases = len(case_inputs)
        packed = _aligned((1, case_inputs.shape[1], kernel.lanes))
        _pack(case_inputs, packed)
        self.inputs = packed[0]
        self.state = _aligned((max(1, len(kernel.recording.cells)), kernel.lanes))
        self.outputs = _aligned((len(program.outputs), kernel.lanes))
        self._spare = _aligned((1, kernel.lanes))
        self._entry = kernel.entry
        self._inputs = packed.ctypes.data
        self._state = self.state.ctypes.data
        self._outputs = (self.outputs if len(program.outputs) else self._spare).ctypes.data

    def step(self, first: int, last: int) -> None:
        """Run ticks first to last, both included, then `end`. Tick 0 starts afresh."""
        self._entry(self._inputs, self._state, None, self._outputs, 1, first, last, self.cases, 0, 0)

    def recorded(self, first: int, last: int) -> np.ndarray:
        """Run these ticks as `step` does; returns the rows [case, row, column] of those ticks."""
        count = max(0, self.kernel.rows(first, last))
        rows = np.empty((self.cases, count, self.kernel.program.columns))
        self._entry(
            self._inputs,
            self._state,
            rows.ctypes.data if rows.size else None,
            self._outputs,
            1,
            first,
            last,
            self.cases,
            rows.shape[1] * rows.shape[2],
            0,
        )
        return rows

    def cells(self) -> Mapping[str, np.ndarray]:
        """The state by name, [lane] each: views, to be read or changed. Cells that nothing reads are not kept."""
        return {name: self.state[slot] for slot, name in enumerate(self.kernel.recording.cells)}


def _aligned(shape: tuple[int, ...]) -> np.ndarray:
    """Zeros, aligned to a cache line and to the widest register."""
    size = math.prod(shape) * 8
    raw = np.zeros(size + 64, dtype=np.uint8)
    offset = -raw.ctypes.data % 64
    return raw[offset : offset + size].view(np.float64).reshape(shape)


def _pack(inputs: np.ndarray, packed: np.ndarray) -> None:
    """Pack [case, input] into [block][input][lane]; lanes beyond the last case repeat it."""
    blocks, width, lanes = packed.shape
    whole = len(inputs) // lanes
    packed[:whole] = inputs[: whole * lanes].reshape(whole, lanes, width).transpose(0, 2, 1)
    if whole < blocks:
        rest = inputs[whole * lanes :]
        packed[whole, :, : len(rest)] = rest.T
        packed[whole, :, len(rest) :] = rest[-1][:, None]
