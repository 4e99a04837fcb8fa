"""Gradients of a run's metrics by its numbers: exact, of the program that runs, carried along from start to end.

The derivative is that of the running program, through sampled laws, held values, delays and splits of steps where
friction brings something to rest, whose instant moves too. Decisions at ticks, such as breaking away or a limit, are
taken as they are: between two of them the program is smooth, and on the edge of one it has no derivative. So each
gradient is held against the program itself a little to each side, and where the two differ none is given.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from met import backends
from met import run as engine
from met.analysis.linear.period import is_converter
from met.backends.backend import Kernel
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen
from met.plan import Experiment
from met.program.build import METRIC, Builder
from met.program.step import FAILURE
from met.program.system import System
from met.run import judge
from met.trace.differentiated import Dependence, dependence, differentiated
from met.trace.program import Recording
from met.trace.recorder import record

NEAR = (1e-6, 1e-5)
"""Shares of a number, to each side, over which its gradients are compared with the change that they predict; for 0,
these in SI. An edge is reported where both differ: the first alone may be rounding of a metric that hardly moves."""

SAME, ROUNDED = 1e-3, 1e-11
"""Shares of that change, and of the metric, within which the two may differ."""

_POINTS = (0.0, *(sign * near for near in NEAR for sign in (-1.0, 1.0)))

MOST_LANES = 100_000
"""Largest number of runs of the kernel held in memory at once."""

FAILED = "the case fails"
"""Reason why a failing case has no slopes."""

Place = tuple[int, int, int]
"""(case, metric, number), as positions in `MetricGradients`."""


@frozen
class MetricGradients:
    """Metrics of cases and their derivatives by numbers of the deck.

    cases    rows of the case table;  metrics: names;  paths: of the numbers
    value    [case, metric], SI; of a metric that moves in steps of a sample as it is between samples
    slope    [case, metric, number], SI; not-a-number where there is none
    why_not  where there is none: why, in words
    """

    cases: tuple[int, ...]
    metrics: tuple[str, ...]
    paths: tuple[str, ...]
    value: np.ndarray
    slope: np.ndarray
    why_not: Mapping[Place, str]


@frozen
class GradientProgram:
    """An experiment's program with tangents by its coordinates, compiled once for all of its cases.

    first  by so many of its coordinates alone, the first ones; None: by all
    """

    experiment: Experiment
    first: int | None = None

    @cached_property
    def recording(self) -> Recording:
        """The program without tangents."""
        experiment = self.experiment
        plain = replace(experiment, structure=replace(experiment.structure, record=()))
        return record(Builder(System(plain, between_samples=True)).program())

    @cached_property
    def kernel(self) -> Kernel:
        """The program with tangents."""
        return backends.load(differentiated(self.recording, self.paths, is_converter))

    @property
    def paths(self) -> tuple[str, ...]:
        """The numbers by which there are gradients."""
        return tuple(coordinate.path for coordinate in self.experiment.cases.coordinates)[: self.first]

    @cached_property
    def dependences(self) -> dict[str, Dependence]:
        """The outputs that depend on each number."""
        return {path: dependence(self.recording, path, is_converter) for path in self.paths}

    def of(
        self,
        rows: Sequence[int] | np.ndarray,
        metrics: Sequence[str] = (),
        *,
        experiment: Experiment | None = None,
        threads: int | None = None,
        edges: bool = True,
    ) -> MetricGradients:
        """The gradients of these rows of the case table.

        metrics     names; all where there are none
        experiment  the same one with other cases;  threads: None: as many as there are cores
        edges       whether each is held against the program a little to each side, which takes five times as long; for
                    who tries what they promise

        Raises Problem D379 for a name that is no metric's, and where no number varies.
        """
        experiment = experiment or self.experiment
        metrics = tuple(metrics) or tuple(use.name for use in experiment.structure.metrics)
        _refuse(experiment, metrics, self.paths)
        rows = np.asarray(rows, dtype=np.int64)
        values, slopes = [np.empty((0, len(metrics)))], [np.empty((0, len(metrics), len(self.paths)))]
        why_not: dict[Place, str] = {}
        points = _POINTS if edges else _POINTS[:1]
        many = max(1, MOST_LANES // (len(self.paths) * len(points)))
        for first in range(0, len(rows), many):
            lanes = _Lanes.of(self, engine.inputs(experiment, rows[first : first + many]), points, threads)
            reasons, slope = dict(self._why_not(lanes, metrics)), lanes.slopes(metrics)
            for place in reasons:
                slope[place] = math.nan
            why_not |= {(first + case, metric, number): why for (case, metric, number), why in reasons.items()}
            values.append(lanes.values(metrics))
            slopes.append(slope)
        of_all = np.concatenate(values), np.concatenate(slopes)
        return MetricGradients(tuple(rows.tolist()), metrics, self.paths, *of_all, why_not)

    def _why_not(self, lanes: _Lanes, metrics: Sequence[str]) -> Iterator[tuple[Place, str]]:
        """The reasons why derivatives are missing, by case, metric and number."""
        failed, value, slope = lanes.failed(), lanes.values(metrics), lanes.slopes(metrics)
        edges = lanes.edges(metrics) if lanes.outputs.shape[2] == len(_POINTS) else np.zeros(slope.shape, dtype=bool)
        for case, metric, number in np.ndindex(*slope.shape):
            place, output = (case, metric, number), METRIC + metrics[metric]
            depends = self.dependences[self.paths[number]]
            if failed[case]:
                yield place, FAILED
            elif math.isnan(value[case, metric]):
                yield place, "the metric is no number"
            elif math.isinf(value[case, metric]):
                yield place, "the metric is infinite"
            elif output in depends.changes - depends.moves:
                yield place, "it moves in steps alone, of a sample or of a count"
            elif math.isnan(slope[place]) or math.isinf(slope[place]):
                yield place, "a derivative on the way is no number"
            elif edges[place]:
                yield place, f"on an event's edge: {lanes.event(case, number)}"


@frozen
class _Lanes:
    """The answers of the kernel: [case, number, point, output], with the points of `_POINTS`, or the first of them
    alone."""

    names: tuple[str, ...]
    outputs: np.ndarray
    steps: np.ndarray

    @classmethod
    def of(
        cls, program: GradientProgram, case_inputs: np.ndarray, points: tuple[float, ...], threads: int | None
    ) -> _Lanes:
        """Run each case at each point of each number, with the tangent of that number, as lanes of one run."""
        kernel, n = program.kernel, len(program.paths)
        cases, own = case_inputs.shape
        steps = np.abs(case_inputs[:, :n])
        steps = np.where(steps > 0.0, steps, 1.0)
        inputs = np.zeros((cases, n, len(points), own + n))
        inputs[..., :own] = case_inputs[:, None, None, :]
        for number in range(n):
            inputs[:, number, :, number] += steps[:, number, None] * points
            inputs[:, number, :, own + number] = 1.0
        ticks = program.experiment.structure.schedule.ticks
        _, outputs = kernel.run(inputs.reshape(-1, own + n), ticks, record=False, threads=threads)
        names = program.recording.program.outputs
        judge(names, outputs[:, : len(names)])
        return cls(names, outputs.reshape(cases, n, len(points), -1), steps)

    def _columns(self, metrics: Iterable[str], first: int) -> np.ndarray:
        return self.outputs[..., [first + self.names.index(METRIC + name) for name in metrics]]

    def values(self, metrics: Iterable[str]) -> np.ndarray:
        """[case, metric]"""
        return self._columns(metrics, 0)[:, 0, 0, :]

    def slopes(self, metrics: Iterable[str]) -> np.ndarray:
        """[case, metric, number]"""
        return np.moveaxis(self._columns(metrics, len(self.names))[:, :, 0, :], 1, 2).copy()

    def failed(self) -> np.ndarray:
        """[case]: whether it fails."""
        return self.outputs[:, 0, 0, self.names.index(FAILURE[0])] != 0.0

    def edges(self, metrics: Iterable[str]) -> np.ndarray:
        """[case, metric, number]: whether the metric changes across the case otherwise than its slopes say.

        Simpson's rule gives the change over both sides from the slopes at the ends and in the middle, but for the fifth
        power of the distance, so that what is left is a jump, or another slope on one side.
        """
        metrics = tuple(metrics)
        value, slope = self._columns(metrics, 0), self._columns(metrics, len(self.names))
        on_edge = np.ones((value.shape[0], value.shape[1], value.shape[3]), dtype=bool)
        for place, near in enumerate(NEAR):
            low, high = 1 + 2 * place, 2 + 2 * place
            step = (near * self.steps)[:, :, None]
            with np.errstate(invalid="ignore"):
                change = value[:, :, high] - value[:, :, low]
                predicted = step / 3.0 * (slope[:, :, low] + 4.0 * slope[:, :, 0] + slope[:, :, high])
                size = np.maximum(np.abs(change), 2.0 * step * np.abs(slope[:, :, 0]))
                within = np.abs(change - predicted) <= SAME * size + ROUNDED * np.abs(value[:, :, 0])
            on_edge &= ~within
        return np.moveaxis(on_edge, 1, 2)

    def event(self, case: int, number: int) -> str:
        """The event that occurs on one side of a case and not on the other, in words."""
        share = f"{NEAR[0]:g} of the number"
        counts = self.outputs[case, number, :, : len(self.names)]
        for name in (FAILURE[0], "friction.splits", "friction.clamped", *_limits(self.names)):
            low, high = counts[1:3, self.names.index(name)]
            if low != high:
                return f"within {share} {_words(name)}"
        return f"within {share} something begins to act, or is decided at another tick"


def _limits(names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith("at_limit:")]


def _words(output: str) -> str:
    """An event that shows in an output of the program, in words."""
    if output == FAILURE[0]:
        return "the run fails"
    if ":" in output:
        return f"`{output.partition(':')[2]}` is reached for another number of steps"
    return "friction stops something another number of times"


def _refuse(experiment: Experiment, metrics: Sequence[str], paths: Sequence[str]) -> None:
    """Raise Problem D379 where a metric has no gradient, or nothing varies."""
    known = [use.name for use in experiment.structure.metrics]
    linear = [use.name for use in experiment.linear_metrics]
    for name in metrics:
        if name in linear:
            message = f"`{name}` is a metric of a linear answer, which has no gradient"
            raise Problem(error("D379", message, experiment.place, help="sweep the number, and compare"))
        if name not in known:
            helps = did_you_mean(name, known) or [
                f"there are {', '.join(f'`{metric}`' for metric in known)}" if known else "a run's `metrics` name them"
            ]
            raise Problem(error("D379", f"`{experiment.name}` has no metric `{name}`", experiment.place, help=helps))
    if not known:
        message = f"`{experiment.name}` has no metric, of which there could be a gradient"
        raise Problem(error("D379", message, experiment.place, help="a `metric` entry of the run names one"))
    if not paths:
        message = f"no number of `{experiment.name}` varies, so there is nothing to take a gradient by"
        helps = ("ask about a sweep: its numbers are those", "or `Simulation.gradient`, by any number of the deck")
        raise Problem(error("D379", message, experiment.place, help=helps))
