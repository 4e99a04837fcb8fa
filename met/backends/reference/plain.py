"""A program run as it is written: one case, Python floats, phase by phase, for a debugger to step through.

Nothing is recorded or fused and sines are the platform's, so its bits are not those of the back ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from met.trace.functions import absolute
from met.trace.graph import Real, Truth
from met.trace.program import CallPhase, Control, Every, Program, RecordPhase, RunPhase, Unless0, WhileAny


class PlainTape:
    """A `Tape` over plain numbers (np.float64, whose arithmetic is IEEE's and raises nothing)."""

    def __init__(self, program: Program, inputs: Mapping[str, float], rows: int) -> None:
        self.program = program
        self.inputs = {name: np.float64(inputs[name]) for name in program.inputs}
        self.cells: dict[str, Real] = {}
        self.rows = np.full((rows, program.columns), np.nan)
        self.outputs: dict[str, float] = {}
        self.k = 0
        self.row = 0

    @property
    def tick(self) -> Real:
        return np.float64(self.k)

    @property
    def time(self) -> Real:
        return np.float64(self.k) / np.float64(self.program.base_hz)

    def read(self, name: str) -> Real:
        return self.cells.get(name, np.float64(0.0))

    def write(self, name: str, value: Real) -> None:
        self.cells[name] = np.float64(value)

    def read_mask(self, name: str) -> Truth:
        return bool(self.read(name) != 0.0)

    def write_mask(self, name: str, value: Truth) -> None:
        self.cells[name] = np.float64(1.0 if value else 0.0)

    def input(self, name: str) -> Real:
        return self.inputs[name]

    def record(self, column: int, value: Real) -> None:
        self.rows[self.row, column] = value

    def output(self, name: str, value: Real) -> None:
        self.outputs[name] = float(value)

    def part(self, name: str) -> AbstractContextManager[None]:
        return nullcontext()


def execute(
    program: Program, inputs: Mapping[str, float] | Sequence[float], ticks: int
) -> tuple[np.ndarray, dict[str, float]]:
    """Run one case from tick 0 to tick `ticks`, both included: (rows [rows, columns], outputs by name).

    inputs   by name, or in the order of `program.inputs`
    """
    if not isinstance(inputs, Mapping):
        inputs = dict(zip(program.inputs, inputs, strict=True))
    tape = PlainTape(program, inputs, ticks // program.record_divisor + 1)
    with np.errstate(all="ignore"):
        follow(tape, program.start)
        for k in range(ticks + 1):
            tape.k = k
            follow(tape, program.tick)
        follow(tape, program.end)
    return tape.rows, tape.outputs


def begun(program: Program, inputs: Mapping[str, float], *, settled: float = 0.0) -> PlainTape:
    """A case after its first tick, its start included. settled: of the loops of the start, as of `follow`"""
    tape = PlainTape(program, inputs, 1)
    with np.errstate(all="ignore"):
        follow(tape, program.start, settled=settled)
        follow(tape, program.tick)
    return tape


def follow(tape: PlainTape, body: tuple[Control, ...], *, settled: float = 0.0) -> None:
    """Run the body once, at the tape's tick.

    settled  loops also end after a turn in which no cell changes by more than this share of its value; 0: they do not
    """
    for node in body:
        match node:
            case RunPhase(phase) | CallPhase(phase):
                phase.body(tape)
            case RecordPhase(phase, divisor):
                if tape.k % divisor == 0:
                    tape.row = tape.k // divisor
                    phase.body(tape)
            case Every(divisor, inner):
                if tape.k % divisor == 0:
                    follow(tape, inner, settled=settled)
            case Unless0(inner):
                if tape.k > 0:
                    follow(tape, inner, settled=settled)
            case WhileAny(cell, at_most, inner):
                for _ in range(at_most):
                    if not tape.read_mask(cell):
                        break
                    before = dict(tape.cells) if settled else {}
                    follow(tape, inner, settled=settled)
                    if settled and all(_near(value, before.get(name), settled) for name, value in tape.cells.items()):
                        break


def _near(value: Real, before: Real | None, share: float) -> bool:
    if value is before:
        return True
    return before is not None and bool(absolute(value - before) <= share * absolute(value))


__all__: list[Any] = ["PlainTape", "begun", "execute", "follow"]
