"""Cases stepped from instant to instant, so that their memory can be examined on the way, with the bits of a run.

A block of the kernel keeps its state from call to call. It is the same code that runs a campaign, so looking changes
nothing and costs a copy of the state at each instant.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import field

import numpy as np

from met.backends.backend import Kernel
from met.frozen import frozen
from met.host import system
from met.plan import Schedule

LONGEST = 1 << 16
"""Largest number of ticks in one call into machine code, which cannot be interrupted."""


BESIDE = 8
"""Steps between neighbouring instants: a few, so that fast changes are seen while they last."""


@frozen
class Memories:
    """The memory of some cases at instants that they pass, collected while they run.

    ticks    rising;  cases: rows of the case table
    by_case  row -> [instant, cell], in the order of the recording's cells
    """

    ticks: tuple[int, ...]
    cases: frozenset[int]
    by_case: dict[int, np.ndarray] = field(default_factory=dict)


def even_ticks(schedule: Schedule, instants: int) -> tuple[int, ...]:
    """Ticks of `instants` instants of the dynamics, spread evenly over a run, each with one that is `BESIDE` steps
    later; fewer in a short run."""
    steps = schedule.ticks // schedule.dynamics
    first = [n * steps // instants for n in range(instants)]
    return tuple(sorted({n * schedule.dynamics for k in first for n in (k, min(k + BESIDE, steps))}))


def run_past(
    kernel: Kernel,
    inputs: np.ndarray,
    ticks: int,
    instants: Sequence[int],
    *,
    record: bool,
    threads: int | None = None,
) -> tuple[np.ndarray | None, np.ndarray, np.ndarray]:
    """Rows and outputs as `Kernel.run` gives them, and the memory [case, instant, cell] at these ticks, which rise.

    threads: None: as many as there are cores. Not for more than a few blocks of cases: their memory is kept whole.
    """
    program = kernel.program
    cases, record = len(inputs), record and program.columns > 0
    ends = sorted({*instants, *range(LONGEST, ticks, LONGEST), ticks})
    outputs = np.empty((cases, len(program.outputs)))
    memory = np.empty((cases, len(instants), len(kernel.recording.cells)))
    pieces: dict[int, list[np.ndarray]] = {}
    wanted, starts, ended = frozenset(instants), range(0, cases, kernel.lanes), threading.Event()

    def work(start: int) -> None:
        """Run the block of cases that begins with case `start`, and keep its memory at the instants; returns the number
        of cases."""
        block = kernel.block(inputs[start : start + kernel.lanes])
        lanes = slice(start, min(start + kernel.lanes, cases))
        width, first, instant_numbers = lanes.stop - lanes.start, 0, iter(range(len(instants)))
        rows = pieces[start] = []
        for last in ends:
            if ended.is_set():
                return
            if record:
                rows.append(block.recorded(first, last))
            else:
                block.step(first, last)
            if last in wanted:
                memory[lanes, next(instant_numbers)] = block.state[: memory.shape[2], :width].T
            first = last + 1
        outputs[lanes] = block.outputs[: outputs.shape[1], :width].T

    with ThreadPoolExecutor(max(1, min(threads or system.cores(), len(starts)))) as pool:
        try:
            for _ in pool.map(work, starts):
                pass
        except BaseException:
            ended.set()
            raise
    if not record:
        return None, outputs, memory
    return np.concatenate([np.concatenate(pieces[start], axis=1) for start in starts]), outputs, memory
