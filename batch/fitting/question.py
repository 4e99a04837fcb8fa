"""A fit as it is asked for: runs and logs, the parameters to estimate, what is known of them; and its answer."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path

import numpy as np

from batch.fitting.estimate import Fit, Fitter, Prior, noise_of
from batch.fitting.known import Known, known
from batch.fitting.logged import DELAY, LoggedRun, LoggedRuns
from batch.measured.log import mapped_column
from batch.measured.residuals import Comparison, compare
from ic.driver.explain import explanations_of
from ic.driver.given_values import GivenRun, given_run, swept_run
from ic.driver.written_value import WrittenValue
from ic.text.complaints import known_words
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.outputs import quoted
from met.plan import Experiment
from met.unit_parser import parse_unit
from met.units import same

_PRIOR = re.compile(r"(?P<path>[^=]+)=\s*normal\(\s*(?P<mean>[^,()]+),\s*(?P<deviation>[^,()]+)\)\s*(?P<unit>.*)")
_EXAMPLE = "such as `gearbox.kt=normal(0.061, 0.002) N*m/A`"


@frozen
class FitAnswer:
    """The answer of a fit.

    fit             the numbers;  known: what the logs tell of them at these
    before, after   of each log its residuals with the deck's and with the fitted numbers
    predicted       of each log that was not fitted, the same two
    """

    fit: Fit
    known: Known
    before: tuple[Comparison, ...]
    after: tuple[Comparison, ...]
    predicted: tuple[tuple[Comparison, Comparison], ...]


@frozen
class Promise:
    """The knowledge that logs and one more would give.

    motion  that would be logged, its name in place of a file;  known: of the parameters
    sweep   of which it is the best case, or the run itself;  judged: number of its cases that could be logged
    """

    motion: LoggedRun
    known: Known
    sweep: Experiment
    judged: int

    @property
    def values(self) -> list[WrittenValue]:
        """The values that make the case out of its run."""
        units = {coordinate.path: coordinate.unit for coordinate in self.sweep.cases.coordinates}
        return [WrittenValue(path, si, units[path]) for path, si in self.motion.fixed.items()]


@frozen
class FitQuestion:
    """Parameters to estimate from logs.

    runs       to fit, and to predict alone: `predicted`
    motions    sweeps and runs that might be logged, with those of their cases that could be
    paths      of the parameters;  start: their values in the deck, SI;  units: those in which the deck writes them
    si_units   of the same
    priors     of some of them, by path
    """

    runs: tuple[LoggedRun, ...]
    predicted: tuple[LoggedRun, ...]
    motions: tuple[tuple[Experiment, tuple[LoggedRun, ...]], ...]
    paths: tuple[str, ...]
    start: np.ndarray
    units: tuple[str, ...]
    si_units: tuple[str, ...]
    priors: Mapping[str, Prior]

    @cached_property
    def logs(self) -> LoggedRuns:
        """The runs and logs that are fitted."""
        return LoggedRuns(self.runs, self.paths)

    def comparisons(self, values: np.ndarray, runs: Sequence[LoggedRun]) -> tuple[Comparison, ...]:
        """The residuals of each log with these values, SI, [path]."""
        return tuple(
            compare(
                run.courses(values),
                run.columns,
                [joint.name for joint in run.deck_run.experiment.structure.joints],
                run.log,
            )
            for run in runs
        )

    def identifiable(self) -> Known:
        """The knowledge that the logs can give of the parameters at the deck's values, from their noise alone."""
        fitter = Fitter(self.logs, self.start, self.priors)
        return known(fitter.slopes_at_start(noise_of(self.logs)), fitter.size, fitter.held)

    def promised(self, progress: Callable[[int], None]) -> tuple[Promise, ...]:
        """The knowledge that the logs and one of each motion could give, as noisy as the logs are; of a sweep, with
        the case that leaves the least uncertainty."""
        noises = noise_of(self.logs)
        channels = [channel for run in self.runs for channel in run.channels]
        noise = {name: max(noises[np.array([channel == name for channel in channels])]) for name in channels}
        fitter = Fitter(self.logs, self.start, self.priors, progress)
        slopes, promises = fitter.slopes_at_start(noises), []
        for sweep, motions in self.motions:
            judged = []
            for motion in motions:
                own = np.array([noise[channel] for channel in motion.channels])
                more = fitter.promised_slopes(LoggedRuns((motion,), self.paths), own)
                judged.append((known(np.vstack([slopes, more]), fitter.size, fitter.held), motion))
            best, motion = min(judged, key=lambda promise: promise[0].worst)
            promises.append(Promise(motion, best, sweep, len(motions)))
        return tuple(promises)

    def answer(self, progress: Callable[[int], None]) -> FitAnswer:
        """Fit the parameters, and say what the fit is worth."""
        fit = Fitter(self.logs, self.start, self.priors, progress).fit()
        size = np.maximum(np.abs(fit.values), fit.size)
        predicted = zip(
            self.comparisons(self.start, self.predicted), self.comparisons(fit.values, self.predicted), strict=True
        )
        return FitAnswer(
            fit,
            known(fit.slopes, size, fit.held, fit.wider),
            self.comparisons(self.start, self.runs),
            self.comparisons(fit.values, self.runs),
            tuple(predicted),
        )


def fit_question(
    deck: str,
    logs: Sequence[str],
    estimates: Sequence[str],
    *,
    priors: Sequence[str] = (),
    predict: Sequence[str] = (),
    motions: Sequence[str] = (),
    defines: Sequence[str] = (),
    include_dirs: Sequence[str] = (),
    settings: Sequence[str] = (),
    columns: Sequence[str] = (),
    zeros: Sequence[tuple[str, float]] = (),
) -> FitQuestion:
    """Read a deck and logs.

    logs, predict  files, each with its run before it where there are several: `slow=slow.csv`
    estimates      paths as `--set` takes them; `links.*.mass` is of all links; `delay of LOG` is of a log's times
    motions        names of runs that might be logged, too, or of sweeps over such motions
    priors         `PATH=normal(MEAN, DEVIATION) UNIT`
    columns        of the logs: `CHANNEL=[FACTOR *] COLUMN [+ OFFSET] [UNIT]`
    zeros          the time at which the run of a log begins, s, by the log's file; by "" of all others

    Raises Problem for mistakes in these.
    """
    runs: dict[str | None, GivenRun] = {}
    pairs = [_run_and_log(run_and_log) for run_and_log in (*logs, *predict)]
    for run, _ in pairs:
        if run not in runs:
            runs[run] = given_run(deck, run, include_dirs=include_dirs, defines=defines, settings=settings)
    swept = [
        swept_run(deck, motion, include_dirs=include_dirs, defines=defines, settings=settings) for motion in motions
    ]
    first = runs[pairs[0][0]]
    every = [*runs.values(), *(run for run, _ in swept)]
    delays = [DELAY + log for _, log in pairs[: len(logs)]]
    paths = _paths(estimates, every, delays)
    begins = dict(zeros)
    named = [path.removeprefix(DELAY) for path in (*begins, *paths) if path in begins or path.startswith(DELAY)]
    unknown = next((file for file in named if file and file not in [log for _, log in pairs]), None)
    if unknown is not None:
        raise _wrong(f"`{unknown}` is no log of this command", "name it as it stands there")
    starts = {path: (0.0, "s") if path in delays else _start(path, every) for path in paths}
    mapped = [mapped_column(column) for column in columns]
    read = [LoggedRun.read(runs[run], log, starts, mapped, begins.get(log, begins.get("", 0.0))) for run, log in pairs]
    for path in paths:
        if path not in delays and not any(path in run.used for run in read[: len(logs)]):
            _check_varies(path, starts[path], first)
            raise _wrong(f"`{path}` has no effect in a run that has a log", "leave it out")
    prior_pairs = [_prior(prior, starts) for prior in priors]
    twice = next(
        (path for path, _ in prior_pairs if [prior_path for prior_path, _ in prior_pairs].count(path) > 1), None
    )
    if twice is not None:
        raise _wrong(f"`{twice}` has two priors", "give one")
    start = np.array([value for value, _ in starts.values()])
    measured = {channel for run in read[: len(logs)] for channel in run.channels}
    return FitQuestion(
        tuple(read[: len(logs)]),
        tuple(read[len(logs) :]),
        tuple(_motion(run, sweep, starts, start, measured) for run, sweep in swept),
        tuple(paths),
        start,
        tuple("s" if path in delays else _owner(path, every).written_in(path)[0] for path in paths),
        tuple(unit for _, unit in starts.values()),
        dict(prior_pairs),
    )


def _motion(
    run: GivenRun,
    groups: Sequence[Experiment],
    starts: Mapping[str, tuple[float, str]],
    start: np.ndarray,
    measured: Collection[str],
) -> tuple[Experiment, tuple[LoggedRun, ...]]:
    """A sweep, or a run, and those of its cases that could be logged. groups: its experiments"""
    (sweep, *more) = groups
    if more or sweep.cases.choices:
        path = sweep.cases.choices[0].path if sweep.cases.choices else ""
        raise _wrong(f"`{sweep.sweep}` varies `{path}`, which decides the program", "let it vary numbers")
    varied = next((coordinate.path for coordinate in sweep.cases.coordinates if coordinate.path in starts), None)
    if varied is not None:
        raise _wrong(f"`{sweep.name}` varies `{varied}`, which is estimated", "let it vary numbers of commands alone")
    return sweep, LoggedRun.imagined(run, starts, start, measured, sweep)


def _run_and_log(text: str) -> tuple[str | None, str]:
    run, equal, log = text.partition("=")
    return (run, log) if equal and run.isidentifier() and not Path(text).exists() else (None, text)


def _paths(estimates: Sequence[str], runs: Sequence[GivenRun], delays: Sequence[str]) -> list[str]:
    """Paths without wildcards, each once: parameters of a form, or else names of definitions and values of that form.
    delays: those of logs. Raises Problem E480 where a form has none, or some that a fit cannot move"""
    matching_paths = []
    for estimate in estimates:
        matching = [estimate]
        if any(letter in estimate for letter in "*?["):
            own = [*delays, *(path for run in runs for path in run.experiment.parameters)]
            names = [name for run in runs for name in _names(run)]
            like = [path for path in own if fnmatchcase(path, estimate)] or [
                name for name in names if fnmatchcase(name, estimate)
            ]
            matching = list(dict.fromkeys(like))
            if not matching:
                raise _wrong(f"no parameter of `{runs[0].name}` is like `{estimate}`", _listing(estimate, runs[0]))
            movable = [path for path in matching if path in {*delays, *_movable(matching, runs)}]
            if movable != matching:
                still = next(path for path in matching if path not in movable)
                message = f"a fit cannot move all that is like `{estimate}`: not `{still}`"
                raise _wrong(message, known_words("estimate of these", movable, len(movable)))
        matching_paths += matching
    return list(dict.fromkeys(matching_paths))


def _names(run: GivenRun) -> list[str]:
    """The paths that set parameters of a run, by its definitions, too, and its values."""
    return [name for scope in run.compiled.scopes for name in (*scope.known, *scope.definitions.lets)]


def _movable(paths: Sequence[str], runs: Sequence[GivenRun]) -> set[str]:
    """Those of these paths whose numbers can vary together in a run."""
    movable = set[str]()
    for run in runs:
        known = ((path, next(explanations_of(run.compiled, path), None)) for path in paths)
        values = {
            path: (explanation.value, explanation.unit)
            for path, explanation in known
            if explanation and isinstance(explanation.value, float)
        }
        _, left_out = run.vary_most(values)
        movable |= values.keys() - set(left_out)
    return movable


def _listing(path: str, run: GivenRun) -> str:
    """The command that lists numbers of a run: those that begin as a path does, or else as the first one does."""
    heads = [name.partition(".")[0] for name in _names(run)]
    head = next((head for head in heads if head == path.partition(".")[0]), heads[0])
    return f"`met explain {quoted(run.deck.file)} {head} --run {run.name}` lists those of `{head}`"


def _owner(path: str, runs: Sequence[GivenRun]) -> GivenRun:
    """The first run that has a parameter, else the first of all."""
    return next((run for run in runs if run.unit(path) is not None), runs[0])


def _start(path: str, runs: Sequence[GivenRun]) -> tuple[float, str]:
    """The deck's value, SI, and its unit. Raises Problem for a path that has no number, or one each in several runs."""
    owner = _owner(path, runs)
    explanations = {run.name: next(explanations_of(run.compiled, path), None) for run in runs}
    values = {name: explanation.value for name, explanation in explanations.items() if explanation is not None}
    if not values:
        _check_varies(path, (0.0, "1"), owner)
    if not values or not all(isinstance(value, float) for value in values.values()):
        shows = f"`met explain {quoted(owner.deck.file)} {path} --run {owner.name}` shows it"
        helps = shows if values else _listing(path, owner)
        raise _wrong(f"`{path}` is no number, and a fit moves numbers", helps)
    if len(set(values.values())) > 1:
        several = " and ".join(f"{value:g} in `{name}`" for name, value in values.items())
        raise _wrong(f"`{path}` is {several} (SI), and a fit gives all runs one", "fit the logs apart")
    return float(next(iter(values.values()))), owner.unit(path) or "1"  # type: ignore[arg-type]


def _check_varies(path: str, start: tuple[float, str], run: GivenRun) -> None:
    """Raise Problem that says why a parameter cannot vary, where it cannot."""
    try:
        run.vary({path: start})
    except Problem as problem:
        first = problem.diagnostics[0]
        if any(diagnostic.code == "E434" for diagnostic in problem.diagnostics):
            raise _wrong(f"`{path}` decides the program, and a fit moves numbers of one", "leave it out") from None
        if f"`{path}`" in first.message:
            raise Problem(error(first.code, first.message, help=first.help)) from None
        parts = [parameter for parameter in run.experiment.parameters if parameter.startswith(f"{path}.")]
        helps = f"it has {', '.join(f'`{part}`' for part in parts[:6])}" if parts else _listing(path, run)
        raise _wrong(f"`{path}` is no number, and a fit moves numbers", helps) from None


def _prior(text: str, starts: Mapping[str, tuple[float, str]]) -> tuple[str, Prior]:
    """The path and the normal distribution, SI, of a text such as `gearbox.kt=normal(0.061, 0.002) N*m/A`. Raises
    Problem."""
    match = _PRIOR.fullmatch(text.strip())
    if match is None:
        raise _wrong(f"`{text}` is not what is known of a parameter", _EXAMPLE)
    path = match["path"].strip()
    if path not in starts:
        raise _wrong(f"`{path}` is not estimated", f"`--estimate {path}`")
    try:
        measure = parse_unit(match["unit"].strip() or "1")
        mean, deviation = (measure.to_si(float(match[part])) for part in ("mean", "deviation"))
    except ValueError:
        raise _wrong(f"`{text}` cannot be read", f"{_EXAMPLE}: two numbers, and a unit") from None
    if not same(measure.dimension, parse_unit(starts[path][1]).dimension):
        raise _wrong(f"`{path}` is not in {match['unit'].strip() or '1'}", f"it is in {starts[path][1]}")
    if not (math.isfinite(mean) and 0.0 < deviation < math.inf):
        raise _wrong(f"`{text}` is no distribution", "its mean is finite, and its standard deviation above 0")
    return path, Prior(mean, deviation)


def _wrong(message: str, help: str) -> Problem:
    return Problem(error("E480", message, help=help))
