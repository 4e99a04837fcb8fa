"""The simulated rest of an arm whose motors are on beds: the kernel with its wires open, stepped at the servos' ticks.

What it computes follows from the rates that were read, so a run is made again, with all that is recorded of it, from
those alone (`again`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from met.backends.backend import Block
from met.plan import Experiment
from met.plant import servo_period
from met.run import Prepared, inputs

LANES = 4
"""Cases of the kernel's block, of which one is driven: the narrowest are not the fastest. Nothing but time depends on
it: a step of a Panda took 2.2 us, of 16 cases 3.9 us (EPYC with AVX-512)."""


class CaseKernel:
    """The kernel of one case, stepped at the servos' ticks.

    prepared  the run with its wires open (met.run.prepare, wire=True)
    row       of the case table;  repeats: exchanges a tick of the servos
    """

    def __init__(self, prepared: Prepared, row: int, repeats: int = 1) -> None:
        """Prepare the case's kernel, not stepped yet, with its inputs from the case table."""
        self.prepared, self.row = prepared, row
        program, schedule = prepared.program, prepared.experiment.structure.schedule
        self.joints = substituted(prepared)
        input_values = np.zeros((1, len(program.inputs)))
        own = inputs(prepared.experiment, np.array([row]))
        input_values[:, : own.shape[1]] = own
        self.block: Block = prepared.kernel.block(input_values)
        self.divisor = divisor(prepared.experiment)
        self.ticks, self.repeats = schedule.ticks, repeats
        self.last = schedule.ticks // self.divisor
        """The servos' last tick."""
        self._rates = [self.block.inputs[program.inputs.index(f"wire:{joint}.rate")] for joint in self.joints]
        self._outputs = [  # the drive's command, and the load's current
            [
                self.block.outputs[index]
                for index, name in enumerate(program.outputs)
                if name.startswith(f"wire:{joint}.")
            ]
            for joint in self.joints
        ]

    @property
    def exchanges(self) -> int:
        """The number of exchanges after the first sample, until the servos' last tick."""
        return self.last * self.repeats

    def __call__(self, e: int, rates: Sequence[float], commands: list[list[float]]) -> None:
        """Step to the instant of exchange e where the servos tick then, and write the commands (`loop.Compute`)."""
        tick, between = divmod(e, self.repeats)
        if between:
            return
        for lane, rate in zip(self._rates, rates, strict=True):
            lane[:] = rate
        step = tick * self.divisor
        self.block.step(max(0, step - self.divisor + 1), step)
        for b, (voltage, current) in enumerate(self._outputs):
            commands[b][0], commands[b][1] = float(voltage[0]), float(current[0])

    def again(self, rates: Iterable[Sequence[float]]) -> tuple[np.ndarray, np.ndarray, int]:
        """Run from rates that were read before, at the servos' ticks from 0 on.

        Returns histories [row, column], not-a-number after the last rate; outputs [output]; and the last base tick.
        """
        program, schedule = self.prepared.program, self.prepared.experiment.structure.schedule
        rows = np.full((schedule.rows if program.columns else 0, program.columns), np.nan)
        record = schedule.record
        done = -1
        for tick, read in enumerate(rates):
            if tick > self.last:
                break
            for lane, rate in zip(self._rates, read, strict=True):
                lane[:] = rate
            done = self._recorded(rows, record, done + 1, tick * self.divisor)
            if tick == self.last and done < self.ticks:
                done = self._recorded(rows, record, done + 1, self.ticks)
        return rows, self.block.outputs[:, 0].copy(), done

    def _recorded(self, rows: np.ndarray, record: int, first: int, last: int) -> int:
        """Run the kernel's ticks from `first` to `last`, and put the rows into `rows`; returns `last`. record: ticks a
        row"""
        recorded = self.block.recorded(first, last)[0]
        if len(rows):
            start = (first + record - 1) // record
            rows[start : start + len(recorded)] = recorded
        return last


def substituted(prepared: Prepared) -> tuple[str, ...]:
    """The joints whose motors are on beds, in the order of the program's wires."""
    return tuple(
        name.removeprefix("wire:").removesuffix(".rate") for name in prepared.program.inputs if name.startswith("wire:")
    )


def divisor(experiment: Experiment) -> int:
    """The number of base ticks in a tick of the servos whose motors are on beds."""
    return round(servo_period(experiment) * experiment.structure.schedule.base_hz)
