"""Records of a bed made into steps of time: its commands and readings, to compare a model with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hw.bed import About
from hw.driving.timing import TICK
from hw.recording.records import ANSWERED
from met.frozen import frozen


@frozen
class Series:
    """A bed's commands and readings as steps of time. Each array has an entry for each step.

    time           length of the step, s
    voltage        held meanwhile, V;  current: A;  angle: of the shaft at its beginning, rad
    rate           read at its end, rad/s; not-a-number where no answer came
    drive_current  read at its end, A; None where the bed does not measure it
    move           number of the move, from 0
    """

    time: np.ndarray
    voltage: np.ndarray
    current: np.ndarray
    angle: np.ndarray
    rate: np.ndarray
    drive_current: np.ndarray | None
    move: np.ndarray

    @property
    def moves(self) -> int:
        return int(self.move[-1]) + 1 if len(self.move) else 0

    def of(self, moves: Sequence[int]) -> Series:
        """The steps of these moves alone, in this order, the moves numbered anew."""
        steps_of = [np.flatnonzero(self.move == move) for move in moves]
        take = np.concatenate(steps_of)
        numbers = np.repeat(np.arange(len(steps_of)), [len(steps) for steps in steps_of])
        amperes = None if self.drive_current is None else self.drive_current[take]
        return Series(
            self.time[take], self.voltage[take], self.current[take], self.angle[take], self.rate[take], amperes, numbers
        )


def series(rows: np.ndarray, about: About, began: Sequence[int], *, lock_step: bool) -> Series:
    """The steps of one bed's records (hw.recording.records.LAYOUT), from its first exchange on.

    began  for each move, the exchange at which the bed was at rest

    A bed in lock-step holds what it is told until it answers; one with a time of its own answers with what it read as
    the command came, and holds that until the next. What was told and not answered is taken for heard, at even times.
    """
    answered = np.flatnonzero((rows["flags"] & ANSWERED) != 0)
    read, scales = rows[answered], about.scales
    spans, ticks = np.diff(answered), np.remainder(np.diff(read["tick"].astype(np.int64)), TICK)
    ends = np.arange(1, answered[-1] + 1)  # exchanges at which steps end
    span = np.repeat(np.arange(len(spans)), spans)
    time = ticks[span] / spans[span] / about.tick_hz
    held = rows[ends if lock_step else ends - 1]
    voltage, current = (
        np.rint(held[name] / scale) * scale
        for name, scale in (("voltage", scales.voltage), ("current", scales.current))
    )
    angle = read["angle"]
    if np.isnan(angle).any():
        means = 0.5 * (read["rate"][1:] + read["rate"][:-1])
        angle = np.concatenate([[0.0], np.cumsum(means * ticks / about.tick_hz)])
    else:
        angle = np.unwrap(angle, period=TICK * scales.angle)
    angle = np.interp(ends - 1, answered, angle)
    heard = np.isin(ends, answered)
    rate = np.where(heard, rows["rate"][ends], np.nan)
    measured = not np.isnan(read["drive_current"]).any()
    move = np.searchsorted(np.asarray(began), ends - 1, side="right") - 1
    keep = np.flatnonzero((time > 0.0) & (move >= 0))
    amperes = np.where(heard, rows["drive_current"][ends], np.nan)[keep] if measured else None
    return Series(time[keep], voltage[keep], current[keep], angle[keep], rate[keep], amperes, move[keep])
