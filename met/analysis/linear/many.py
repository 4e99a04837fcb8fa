"""Jacobians of a period of many cases at once, in machine code. Events on the way are not looked for (`jacobian` does).

The first one costs the making of the program, which for seven joints with servos takes half a minute; then each costs
some five times a plain step.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from met import backends
from met import run as engine
from met.analysis.linear.period import PeriodProgram, is_converter
from met.backends.backend import Kernel
from met.frozen import frozen
from met.trace.directions import entry, with_jacobian
from met.trace.recording import Recording


@frozen
class PeriodJacobians:
    """A run's program with the Jacobian of each period. Raises ValueError where a body moves freely: how it turns is no
    number of its memory."""

    program: PeriodProgram

    @cached_property
    def recording(self) -> Recording:
        """The program that is compiled."""
        program = self.program
        if program.bodies:
            raise ValueError("a body that moves freely has no Jacobian by the cells of its turn")
        return with_jacobian(program.prepared.recording, program.states, program.ticks, is_converter)

    @cached_property
    def kernel(self) -> Kernel:
        return backends.load(self.recording)

    def at(self, rows: Sequence[int] | np.ndarray, period: int, threads: int | None = None) -> np.ndarray:
        """A of `jacobian.PeriodMap` by all states of the program, [case, state, state], of the period of that number;
        the first is 0. Where something sticks its rows and columns are there too, as it is held.

        rows  of the case table
        """
        states = self.program.states
        inputs = engine.inputs(self.program.experiment, np.asarray(rows, dtype=np.int64))
        _, outputs = self.kernel.run(inputs, (period + 1) * self.program.ticks, record=False, threads=threads)
        first = self.recording.program.outputs.index(entry(states[0], states[0]))
        found: np.ndarray = outputs[:, first : first + len(states) ** 2]
        return found.reshape(len(inputs), len(states), len(states)).copy()
