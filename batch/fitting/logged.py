"""Runs of a deck beside logs: what the runs compute at the logs' instants, for many values of their parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from batch.measured.log import MappedColumn, read_log
from batch.measured.mcap_log import MeasuredSignals
from batch.measured.paired import LARGEST, ComputedChannel
from batch.modules.description import described_columns
from ic.driver.given_values import GivenRun, VariedRun
from met import run as engine
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.outputs import quoted
from met.plan import Experiment

MOST_NUMBERS = 100_000
"""Largest number of measured numbers of a log that are fitted; a longer one is thinned."""

MOST_BYTES = 2**29
"""Largest size of the histories that are in memory at once."""


DELAY, LATEST = "delay of ", 0.1
"""The beginning of the path of a log's delay, s, before its name: by how much its times are late; and the largest delay
of either sign that is estimated."""

STRETCHES = 24
"""Least number of stretches of logs by which intervals are judged."""


@frozen
class LoggedRun:
    """A run beside a log of the real arm.

    deck_run  the run;  file: of the log;  log: its signals
    paths     the parameters that get values; of these the run depends on those of `varied` alone, and the log's times
              on its delay
    fixed     values of other parameters of `varied`, SI, by path
    zero      the time in the file at which the run begins, s
    """

    deck_run: GivenRun
    file: str
    log: MeasuredSignals
    paths: tuple[str, ...]
    varied: VariedRun
    fixed: Mapping[str, float] = field(default_factory=dict)
    zero: float = 0.0

    @classmethod
    def read(
        cls,
        run: GivenRun,
        file: str,
        starts: Mapping[str, tuple[float, str]],
        mapped: Sequence[MappedColumn] = (),
        zero: float = 0.0,
    ) -> LoggedRun:
        """Read a log, and compile the run with these parameters as its inputs.

        starts        by path, a value and its unit
        mapped, zero  as `batch.measured.log.read_log` has them

        Raises Problem for a log that does not fit beside the run (E478), and for a parameter that cannot vary.
        """
        log = read_log(file, described_columns(run.experiment), mapped, zero)
        varied, _ = run.vary_most(_of_deck(starts))
        logged = cls(run, file, log, tuple(starts), varied, zero=zero)
        if not len(logged.measured):
            message = f"no number of `{file}` has one of the run beside it"
            begins = min((float(times[0]) for times, _ in log.signals.values() if len(times)), default=0.0) + zero
            helps = f"if the run begins with the log: `--zero {quoted(f'{file}={begins:.12g} s')}`"
            raise Problem(error("E478", message, log.head, help=helps))
        return logged

    @classmethod
    def imagined(
        cls,
        run: GivenRun,
        starts: Mapping[str, tuple[float, str]],
        start: np.ndarray,
        measured: Collection[str],
        sweep: Experiment,
    ) -> tuple[LoggedRun, ...]:
        """A run, in each case of a sweep, as if it had been logged: with what it computes at its recorded rows, of
        channels that are `measured`. Cases that `is_allowed` refuses are left out. Raises Problem E480 where none is
        left.

        starts, start  values of the parameters, by path with their units, and SI alone, [path]
        sweep          its cases, or the run itself
        """
        coordinates = sweep.cases.coordinates
        further = {
            coordinate.path: (float(coordinate.values[0]), run.unit(coordinate.path) or "1")
            for coordinate in coordinates
        }
        varied, _ = run.vary_most({**_of_deck(starts), **further})
        first, motions = cls(run, sweep.name, MeasuredSignals({}, [], []), tuple(starts), varied), []
        for number in range(sweep.cases.count):
            fixed = {coordinate.path: float(coordinate.values[number]) for coordinate in coordinates}
            motion = first._with_fixed(f"{sweep.name} #{number}" if coordinates else sweep.name, fixed)
            if coordinates and not motion.is_allowed(start):
                continue
            signals = {name: course for name, course in motion.courses(start).items() if name in measured}
            motion.log.signals.update({name: (course.times, course.values) for name, course in signals.items()})
            motions += [motion] if signals else []
        if not motions:
            message = f"`{sweep.name}` records nothing that a log has, or fails at its start"
            if coordinates:
                message = f"no case of `{sweep.name}` ends within limits and requirements, and records what a log has"
            raise Problem(error("E480", message, sweep.place, help="let it record what was logged"))
        return tuple(motions)

    def _with_fixed(self, name: str, fixed: Mapping[str, float]) -> LoggedRun:
        """The same run with other values of `fixed` and an empty log of this name. The program is shared."""
        run = replace(self, file=name, fixed=fixed, log=MeasuredSignals({}, [], []))
        run.__dict__["_prepared"] = self._prepared
        return run

    def is_allowed(self, values: np.ndarray) -> bool:
        """True if a case reaches its end, within the limits of all joints and with all requirements met. values: of
        `paths`, SI, [path]"""
        result = engine.run(self._with(self.inputs(values[None, :])), record=False)
        outside = any(excess[0] > 0.0 for excess in result.excess.values())
        return bool(result.status[0] == engine.DONE and not outside and all(met[0] for met in result.met.values()))

    @property
    def name(self) -> str:
        """The run and the log, in words."""
        return f"{self.deck_run.name} and {self.file}"

    @cached_property
    def used(self) -> tuple[str, ...]:
        """The parameters on which the run depends, fixed ones included."""
        return tuple(coordinate.path for coordinate in self.varied.experiment.cases.coordinates)

    @cached_property
    def columns(self) -> list[dict[str, str]]:
        """The recorded channels, in the order of a history's columns, each with its SI unit."""
        return described_columns(self.deck_run.experiment)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """The channels that run and log have."""
        return tuple(column["channel"] for column in self.columns if column["channel"] in self.log.signals)

    @cached_property
    def _prepared(self) -> engine.Prepared:
        return engine.prepare(self.varied.experiment)

    @cached_property
    def _usable(self) -> list[np.ndarray]:
        """By channel, the log's instants that have a number and one of the run beside it, as positions."""
        first = LATEST if DELAY + self.file in self.paths else 0.0
        last, usable = self._times[-1] - first, []
        for channel in self.channels:
            instants, measured = self.log.signals[channel]
            with np.errstate(invalid="ignore"):
                usable.append(np.flatnonzero((instants >= first) & (instants <= last) & (np.abs(measured) <= LARGEST)))
        return usable

    @property
    def thinned(self) -> bool:
        """True if the log has more numbers than are fitted."""
        return sum(map(len, self._usable)) > MOST_NUMBERS

    @cached_property
    def _rows(self) -> list[np.ndarray]:
        """By channel, the log's instants that are fitted, as positions."""
        every = -(-sum(map(len, self._usable)) // MOST_NUMBERS)
        return [rows[:: max(1, every)] for rows in self._usable]

    @cached_property
    def instants(self) -> np.ndarray:
        """The instants that are fitted, s, one channel after the other, [number]."""
        return self._of_log(0)

    @cached_property
    def measured(self) -> np.ndarray:
        """The measured numbers at `instants`, SI, [number]."""
        return self._of_log(1)

    def _of_log(self, part: int) -> np.ndarray:
        """The instants of the log that are fitted (part 0), or the numbers measured at these (part 1), one channel
        after the other, [number]."""
        signals = zip(self.channels, self._rows, strict=True)
        return np.concatenate([np.empty(0), *(self.log.signals[channel][part][rows] for channel, rows in signals)])

    @cached_property
    def channel_of(self) -> np.ndarray:
        """The position of each number's channel in `channels`, [number]."""
        return np.repeat(np.arange(len(self.channels)), [len(rows) for rows in self._rows])

    def inputs(self, values: np.ndarray) -> np.ndarray:
        """The values of `used`, SI, [case, path], from those of `paths`, with those of `fixed` beside them."""
        paths = [*self.paths, *self.fixed]
        every = np.hstack([values, np.tile([*self.fixed.values()], (len(values), 1))])
        return np.asarray(every[:, [paths.index(path) for path in self.used]])

    def computed(self, values: np.ndarray) -> np.ndarray:
        """The numbers computed at `instants`, on straight lines between recorded rows, [case, number]; not-a-number in
        cases that fail, or have a value that its parameter cannot have.

        values  of `paths`, SI, [case, path]
        """
        out = np.full((len(values), len(self.measured)), np.nan)
        own, delays = self.inputs(values), self._delays(values)
        rows = np.flatnonzero(~self.refused(values))
        many = max(1, MOST_BYTES // max(1, self.deck_run.experiment.structure.history_bytes))
        for first in range(0, len(rows), many):
            some = rows[first : first + many]
            for row, history in zip(some, self._histories(own[some]), strict=True):
                out[row] = self._at_instants(history, float(delays[row]))
        return out

    def refused(self, values: np.ndarray) -> np.ndarray:
        """True for each case with a value that its parameter cannot have, [case]. values: of `paths`, SI, [case,
        path]"""
        broken = self.varied.broken(dict(zip(self.used, self.inputs(values).T, strict=True)), len(values))
        return np.asarray(broken | (np.abs(self._delays(values)) > LATEST))

    def _delays(self, values: np.ndarray) -> np.ndarray:
        """By how much the log is late, s, [case]. values: of `paths`, SI, [case, path]"""
        path = DELAY + self.file
        return values[:, self.paths.index(path)] if path in self.paths else np.zeros(len(values))

    def courses(self, values: np.ndarray) -> dict[str, ComputedChannel]:
        """The signals that one case computes, by channel. values: of `paths`, SI, [path]"""
        history = self._histories(self.inputs(values[None, :]))[0]
        courses, times = {}, self._times + self._delays(values[None, :])[0]
        for column, column_about in enumerate(self.columns):
            finite = np.isfinite(history[:, column])
            if finite.any():
                courses[column_about["channel"]] = ComputedChannel(times[finite], history[finite, column])
        return courses

    def cause(self, values: np.ndarray) -> str:
        """The reason why a case fails, in words. values: of `paths`, SI, [path]"""
        return engine.run(self._with(self.inputs(values[None, :])), record=False).cause[0]

    @property
    def _times(self) -> np.ndarray:
        schedule = self.deck_run.experiment.structure.schedule
        return np.arange(schedule.rows) * schedule.record / schedule.base_hz

    def _with(self, own: np.ndarray) -> engine.Prepared:
        """The run with these values of its parameters as cases, [case, path]."""
        cases = self.varied.experiment.cases
        coordinates = tuple(
            replace(coordinate, values=column) for coordinate, column in zip(cases.coordinates, own.T, strict=True)
        )
        return self._prepared.with_cases(replace(cases, count=len(own), coordinates=coordinates))

    def _histories(self, own: np.ndarray) -> np.ndarray:
        """The recorded numbers of a run for these values of its parameters, [case, row, column]. own: values of `used`,
        [case, path]"""
        result = engine.run(self._with(own), record=True)
        signals = [recorded.name for recorded in self.deck_run.experiment.structure.record]
        return np.concatenate(
            [result.signals[signal].reshape(len(own), len(result.time), -1) for signal in signals], axis=2
        )

    def _at_instants(self, history: np.ndarray, delay: float) -> np.ndarray:
        """The numbers of a history, [row, column], at the log's instants less a delay, s, [number]."""
        low, share = self._between if delay == 0.0 else self._between_rows(delay)
        return np.asarray((1.0 - share) * history[low, self._column] + share * history[low + 1, self._column])

    @cached_property
    def _between(self) -> tuple[np.ndarray, np.ndarray]:
        return self._between_rows(0.0)

    def _between_rows(self, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """By number, the recorded row before its instant less the delay, s, and its share of the way to the next
        row."""
        times, instants = self._times, self.instants - delay
        low = np.clip(np.searchsorted(times, instants, side="right") - 1, 0, len(times) - 2)
        return low, (instants - times[low]) / (times[low + 1] - times[low])

    @cached_property
    def _column(self) -> np.ndarray:
        """The column of each number in a history, [number]."""
        names = [column["channel"] for column in self.columns]
        return np.array([names.index(channel) for channel in self.channels], dtype=np.int64)[self.channel_of]


def _of_deck(starts: Mapping[str, tuple[float, str]]) -> dict[str, tuple[float, str]]:
    """The parameters that are none of a log."""
    return {path: start for path, start in starts.items() if not path.startswith(DELAY)}


@frozen
class LoggedRuns:
    """Runs beside logs whose numbers are fitted together. paths: of the parameters, those of each run"""

    runs: Sequence[LoggedRun]
    paths: tuple[str, ...]

    @cached_property
    def measured(self) -> np.ndarray:
        """All measured numbers, SI, [number]."""
        return np.concatenate([run.measured for run in self.runs])

    @cached_property
    def signal_of(self) -> np.ndarray:
        """The number of each number's signal: a channel of one log, counted over all logs, [number]."""
        first, signal_numbers = 0, []
        for run in self.runs:
            signal_numbers.append(first + run.channel_of)
            first += len(run.channels)
        return np.concatenate(signal_numbers)

    @cached_property
    def stretch_of(self) -> np.ndarray:
        """The number of each number's stretch of time, of which each log has as many, [number]."""
        stretch_numbers = []
        for number, run in enumerate(self.runs):
            first, last = float(run.instants.min()), float(run.instants.max())
            share = (run.instants - first) / max(last - first, 1e-300)
            stretch_numbers.append(
                number * self.stretches + np.minimum(share * self.stretches, self.stretches - 1).astype(int)
            )
        return np.concatenate(stretch_numbers)

    @property
    def stretches(self) -> int:
        """Number of stretches of each log: in all, three times as many as parameters, and `STRETCHES` at least."""
        return max(2, -(-max(STRETCHES, 3 * len(self.paths)) // len(self.runs)))

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """The measured less the computed numbers, [case, number]; not-a-number in cases that fail or are refused.

        values  SI, [case, path]
        """
        return self.measured - np.concatenate([run.computed(values) for run in self.runs], axis=1)

    def refused(self, values: np.ndarray) -> np.ndarray:
        """True for each case with a value that its parameter cannot have in one of the runs, [case]. values: SI, [case,
        path]"""
        return np.asarray(np.any([run.refused(values) for run in self.runs], axis=0))
