"""Running cases: an experiment's cases go through its kernel, and the end of each is put in words."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from met import backends
from met.backends.backend import Kernel
from met.causes import causes_of, doubt_of
from met.frozen import frozen
from met.passing import Memories, run_past
from met.plan import REPEAT, Cases, Experiment, keys
from met.plan.judged import ANSWERED, NOT_ASKED, WHY_ANSWER, WHY_NONE
from met.plan.limits import LimitUse, extremes, limits
from met.plan.outputs import GRAPPLE_FIGURES, grappled_payloads
from met.program import cells, plausible
from met.program.build import COORDINATE, METRIC, UNHELD, build
from met.program.control.substituted import LIMITED
from met.program.step import EVENTS, FAILURE, TOO_FAST, UNBALANCED
from met.program.system import FURTHEST
from met.trace.identity import result_keys, state_key
from met.trace.program import Program, Recording
from met.trace.recorder import record

DONE, FAILED, TIMED_OUT, LOST = range(4)
"""Status of a case: done; failed by its own numbers; stopped for taking too long; lost, each time with its worker."""

STOPPED = 3.0
"""The output `failure` of a case that was ended from outside the engine; its fate says why."""


@frozen
class Run:
    """Results of some cases of one experiment; the first axis of every array is the case.

    case         row of the case table
    status       DONE, FAILED, TIMED_OUT or LOST;  cause: why, with time and joint, empty where done
    n_valid      recorded rows before the failure; all of them where done
    time         (row,) s, of the recorded rows
    signals      by name of `plan.Recorded`: (case, row), then its `shape` (joints, components); not-a-number from
                 n_valid on. Empty where histories were not asked for
    metrics      by name, SI; not-a-number where the case failed
    met          requirements by their text: True where met; False for a failed case
    coordinates  the varied parameters as the engine used them, by path, SI
    events       friction events by name: splits, clamped, undecided (docs/physics.md, section 6)
    limited      ticks at which the load motor of a bed was at its limit
    at_limit     share of the run's time at each limit, by the path of its parameter; not-a-number where the case failed
    excess       largest excess over each limit of a joint, by its path, in the limit's unit; 0 within, not-a-number
                 where the case failed
    extreme_at   of required metrics that keep an extreme: the number of the limit that was reached there, from 1 in the
                 order of `met.plan.limits.extremes`; 0 where none was, or the case failed
    grapples     figures of each grapple (`met.plan.outputs.GRAPPLE_FIGURES`) by `PAYLOAD.FIGURE`; not-a-number where it
                 never came, or the case failed
    warning      what makes a case that is done doubtful, in words, empty where nothing does
    """

    case: np.ndarray
    status: np.ndarray
    cause: list[str]
    n_valid: np.ndarray
    time: np.ndarray
    signals: dict[str, np.ndarray]
    metrics: dict[str, np.ndarray]
    met: dict[str, np.ndarray]
    coordinates: dict[str, np.ndarray]
    events: dict[str, np.ndarray]
    limited: np.ndarray
    at_limit: dict[str, np.ndarray]
    excess: dict[str, np.ndarray]
    extreme_at: dict[str, np.ndarray]
    grapples: dict[str, np.ndarray]
    warning: list[str]


@frozen
class Prepared:
    """An experiment with its program; the kernel is compiled, or fetched from the cache, when first used.

    wire, late, furthest  as `met.program.build.build` has them
    """

    experiment: Experiment
    lanes: int | None = None
    wire: bool = False
    late: int = 0
    furthest: bool = False

    @cached_property
    def program(self) -> Program:
        return build(self.experiment, wire=self.wire, late=self.late, furthest=self.furthest)

    @cached_property
    def recording(self) -> Recording:
        return record(self.program)

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """The names of all outputs of a case: those of its program; then metrics of linear answers, and the reasons why
        one is missing, by the name of each answer."""
        answers = dict.fromkeys(use.of for use in self.experiment.linear_metrics)
        more = (
            *(METRIC + use.name for use in self.experiment.linear_metrics),
            *(WHY_ANSWER + name for name in answers),
        )
        return (*self.program.outputs, *more)

    @cached_property
    def furthest_names(self) -> tuple[str, ...]:
        """The names of metrics with the furthest values between samples, where these are wanted."""
        return tuple(name.removeprefix(METRIC) for name in self.program.outputs if name.endswith(FURTHEST))

    @cached_property
    def companions(self) -> dict[str, Any]:
        """Other programs of this experiment, kept with it by the modules that make them (`met.analysis`)."""
        return {}

    @cached_property
    def kernel(self) -> Kernel:
        return backends.load(self.recording, self.lanes)

    @cached_property
    def code_key(self) -> str:
        """Key of everything that decides the state: where it is equal, equal inputs give equal bits of it. The same on
        any machine (`met.trace.identity`)."""
        return _code_key(state_key(self.recording))

    @cached_property
    def result_keys(self) -> dict[str, str]:
        """Keys of the computation of each metric and each recorded signal from the state, by `metrics.NAME` and
        `record.NAME`."""
        structure, columns, first = self.experiment.structure, {}, 0
        for recorded in structure.record:
            columns[f"record.{recorded.name}"] = range(first, first + len(recorded.channels))
            first += len(recorded.channels)
        outputs = {f"metrics.{use.name}": METRIC + use.name for use in structure.metrics}
        keys = result_keys(self.recording, {**columns, **outputs})
        return {name: _code_key(key) for name, key in keys.items()} | self._linear_keys

    @property
    def _linear_keys(self) -> dict[str, str]:
        """Keys of the metrics of linear answers: of the motion from which they are derived, and of the question."""
        questions = {
            use.name: (use.at, use.inputs, use.outputs, use.opened, use.pose) for use in self.experiment.linear
        }
        return {
            f"metrics.{use.name}": _code_key(
                hashlib.sha256(f"{self.code_key} {LINEAR_VERSION} {use.model} {questions[use.of]}".encode()).hexdigest()
            )
            for use in self.experiment.linear_metrics
        }

    @cached_property
    def work_key(self) -> str:
        """Key of all outputs of a case, in order: the state, every recorded signal and every metric, and other watched
        outputs."""
        known = (*(self.program.state_outputs or ()), *(METRIC + use.name for use in self.experiment.structure.metrics))
        watched = {name: name for name in self.program.outputs if name not in known and not name.startswith(COORDINATE)}
        of_watched = result_keys(self.recording, watched) if watched else {}
        all_keys = self.result_keys | {name: _code_key(key) for name, key in of_watched.items()}
        keys = [self.code_key, *(f"{name} {key}" for name, key in all_keys.items())]
        return _code_key(hashlib.sha256("\n".join(keys).encode()).hexdigest())

    @cached_property
    def old_code_key(self) -> str:
        """Key of all outputs of a case as made before keys had a version: of the emitted text, for blocks of 8
        cases."""
        from met.backends.llvm.emit import emit

        return hashlib.sha256(emit(self.recording, 8).encode()).hexdigest()

    def of_cases(self, experiment: Experiment) -> Prepared:
        """The same program, ready to run the cases of an experiment that differs only in its case table."""
        prepared = Prepared(experiment, self.lanes, self.wire, self.late, self.furthest)
        ready = (*_OF_ANY_CASES, "kernel", "work_key", "old_code_key")
        prepared.__dict__.update({name: self.__dict__[name] for name in ready if name in self.__dict__})
        return prepared

    def is_work(self, key: str) -> bool:
        """True where the key is this work's, in this version of keys or the one before."""
        return key == self.work_key or key == self.old_code_key

    @cached_property
    def limits(self) -> tuple[LimitUse, ...]:
        """The limits that can be reached in a case."""
        return limits(self.experiment.structure, self.experiment.parameters)

    @cached_property
    def extremes(self) -> tuple[str, ...]:
        """The required metrics that say at which limit they took their extreme."""
        return tuple(extremes(self.experiment))

    def with_cases(self, cases: Cases) -> Prepared:
        """The same program for other values of the same coordinates; compiled code is shared."""
        prepared = replace(self, experiment=replace(self.experiment, cases=cases))
        prepared.__dict__.update({name: getattr(self, name) for name in _OF_PROGRAM})
        return prepared


_OF_ANY_CASES = ("program", "recording", "outputs", "companions", "code_key", "result_keys")
_OF_PROGRAM = (*_OF_ANY_CASES, "kernel", "limits", "extremes")
"""The parts of a `Prepared` that are the same whatever values its cases have."""

LINEAR_VERSION = 3
"""Version of linear answers; raised where the numbers for the same program change."""


KEY_VERSION = 2
"""Prefix of code keys: the version of their ingredients. Older keys have none."""


def _code_key(recording_key: str) -> str:
    """A key of a recording, with everything else that decides its bits: how the back end runs it."""
    return f"{KEY_VERSION}:{hashlib.sha256(f'{recording_key} {backends.find().version}'.encode()).hexdigest()}"


def comparable(key: str | None, other: str | None) -> bool:
    """True where both code keys exist, and have the same ingredients."""
    return key is not None and other is not None and key.partition(":")[1] == other.partition(":")[1]


def prepare(experiment: Experiment, *, lanes: int | None = None, wire: bool = False, late: int = 0) -> Prepared:
    """Make an experiment ready to run; lanes: cases a block, None for what suits the machine."""
    return Prepared(experiment, lanes, wire, late)


def run(
    experiment: Experiment | Prepared,
    cases: Sequence[int] | np.ndarray | None = None,
    *,
    threads: int | None = None,
    record: bool = True,
    progress: Callable[[int], None] | None = None,
    lanes: int | None = None,
) -> Run:
    """Run cases (rows of the case table; all by default) and gather their results.

    threads   None: as many as there are cores.  record: whether to keep histories
    progress  called with the number of cases done so far
    """
    prepared = experiment if isinstance(experiment, Prepared) else prepare(experiment, lanes=lanes)
    rows = np.arange(prepared.experiment.cases.count) if cases is None else np.asarray(cases, dtype=np.int64)
    history, outputs = compute(prepared, rows, threads=threads, record=record, progress=progress)
    return results(prepared, rows, history, outputs)


def compute(
    prepared: Prepared,
    rows: np.ndarray,
    *,
    threads: int | None = None,
    record: bool = True,
    progress: Callable[[int], None] | None = None,
    memories: Memories | None = None,
) -> tuple[np.ndarray | None, np.ndarray]:
    """The kernel's answer for these rows, for `results`: histories [case, row, column], if they are kept and exist, and
    outputs [case, output], in the program's order.

    memories  gets the memory of those of these cases that it wants
    """
    case_inputs, ticks = inputs(prepared.experiment, rows), prepared.experiment.structure.schedule.ticks
    record = record and prepared.program.columns > 0
    watched = np.zeros(len(rows), bool) if memories is None else np.isin(rows, list(memories.cases))
    if memories is None or not watched.any():
        history, outputs = prepared.kernel.run(case_inputs, ticks, record=record, threads=threads, progress=progress)
    else:
        history, outputs, memory = run_past(
            prepared.kernel, case_inputs[watched], ticks, memories.ticks, record=record, threads=threads
        )
        memories.by_case.update(zip(rows[watched].tolist(), memory, strict=True))
        if progress is not None:
            progress(int(watched.sum()))
        if not watched.all():
            others, ended = prepared.kernel.run(case_inputs[~watched], ticks, record=record, threads=threads)
            outputs = _together(watched, outputs, ended)
            if history is not None and others is not None:
                history = _together(watched, history, others)
    judge(prepared.program.outputs, outputs)
    return history, with_linear(prepared, outputs)


def judge(names: Sequence[str], outputs: np.ndarray) -> None:
    """Write failures into the outputs [case, output], whose names these are: those that the program's watch found in
    cases which it carried to their end. The first failure of each case stays."""
    column = {name: outputs[:, place] for place, name in enumerate(names)}
    failure, subject, tick = (column[name] for name in FAILURE)

    def write(first: np.ndarray, cause: float, number: np.ndarray, ticks: np.ndarray) -> None:
        failure[first], subject[first], tick[first] = cause, number[first], ticks[first]

    if plausible.FAILED_TICK in column:
        failed_tick = column[plausible.FAILED_TICK]
        write(
            (failed_tick != 0.0) & ((failure == 0.0) | (tick > failed_tick)),
            TOO_FAST,
            column[plausible.OF],
            failed_tick,
        )
    if UNHELD in column:
        unheld = column[UNHELD]
        write((unheld != 0.0) & ((failure == 0.0) | (tick > 0.0)), UNBALANCED, unheld - 1.0, np.zeros_like(tick))


def with_linear(prepared: Prepared, outputs: np.ndarray) -> np.ndarray:
    """The outputs of a program, [case, output], with empty columns for metrics of linear answers
    (`met.analysis.linear.metrics`)."""
    more = prepared.outputs[len(prepared.program.outputs) :]
    if not more:
        return outputs
    pending = [float(NOT_ASKED) if name.startswith(WHY_ANSWER) else math.nan for name in more]
    return np.hstack([outputs, np.tile(pending, (len(outputs), 1))])


def _together(first: np.ndarray, of_first: np.ndarray, of_others: np.ndarray) -> np.ndarray:
    """Arrays of the cases where `first` is True, and of the others, merged in the cases' order."""
    merged = np.empty((len(first), *of_first.shape[1:]))
    merged[first], merged[~first] = of_first, of_others
    return merged


def inputs(experiment: Experiment, rows: np.ndarray) -> np.ndarray:
    """The kernel's inputs for these rows of the case table, [case, input]."""
    cases = experiment.cases
    values = np.empty((len(rows), len(cases.coordinates) + len(cases.noise)))
    for column, coordinate in enumerate(cases.coordinates):
        values[:, column] = coordinate.values[rows]
    for column, name in enumerate(cases.noise, start=len(cases.coordinates)):
        if name == REPEAT:
            assert cases.repeats is not None
            values[:, column] = cases.repeats[rows]
        else:
            values[:, column] = keys.case_seeds(experiment, rows)
    return values


def results(
    prepared: Prepared,
    rows: np.ndarray,
    history: np.ndarray | None,
    outputs: np.ndarray,
    fates: Mapping[int, tuple[int, str]] | None = None,
) -> Run:
    """Results of these rows, from the answer of `compute`. Writes not-a-number into `history` after a failure.

    fates  of rows (by their place in `rows`) for which nothing was computed: TIMED_OUT or LOST, and why; or FAILED,
           where something else than the engine ended them at the tick that `failure.tick` says
    """
    experiment = prepared.experiment
    schedule = experiment.structure.schedule
    steps, watched = schedule.ticks // schedule.dynamics, prepared.limits
    out = {name: outputs[:, column] for column, name in enumerate(prepared.outputs)}
    failed = out["failure"] != 0.0
    n_valid = np.where(failed, np.ceil(out["failure.tick"] / schedule.record), schedule.rows).astype(np.int64)
    causes = [""] * len(rows)
    failures = np.flatnonzero(failed & (out["failure"] != STOPPED))
    if len(failures):
        of_failures = {name: values[failures] for name, values in out.items()}
        words = causes_of(experiment, inputs(experiment, rows[failures]), of_failures)
        for case, cause in zip(failures.tolist(), words, strict=True):
            causes[case] = cause
    status = np.where(failed, FAILED, DONE).astype(np.int8)
    for fated, (ended, why) in (fates or {}).items():
        status[fated], failed[fated], causes[fated] = ended, True, why
        if ended != FAILED:
            n_valid[fated] = 0
        for coordinate in experiment.cases.coordinates:
            out[COORDINATE + coordinate.path][fated] = coordinate.values[rows[fated]]
    for case, cause in _misapplied(experiment, rows, out).items():
        status[case], failed[case], n_valid[case], causes[case] = FAILED, True, 0, cause
    warnings = [""] * len(rows)
    for case in np.flatnonzero(~failed & (out.get(plausible.DOUBTFUL_TICK, failed) != 0.0)).tolist():
        warnings[case] = doubt_of(experiment, {name: float(figures[case]) for name, figures in out.items()})
    for case, why in _unanswered(experiment, out, failed).items():
        warnings[case] = "; ".join([*([warnings[case]] if warnings[case] else []), why])
    signals: dict[str, np.ndarray] = {}
    if history is not None:
        for case in np.flatnonzero(failed).tolist():
            history[case, n_valid[case] :, :] = math.nan
        column = 0
        for recorded in experiment.structure.record:
            width = len(recorded.channels)
            block = history[:, :, column : column + width]
            signals[recorded.name] = block.reshape(*block.shape[:2], *recorded.shape)
            column += width
    names = [*(use.name for use in experiment.metrics), *prepared.furthest_names]
    metrics = {name: np.where(failed, math.nan, out[METRIC + name]) for name in names}
    return Run(
        case=rows,
        status=status,
        cause=causes,
        n_valid=n_valid,
        time=np.arange(schedule.rows) * schedule.record / schedule.base_hz,
        signals=signals,
        metrics=metrics,
        met={r.text: _met(metrics[r.metric], r.comparison, r.limit) for r in experiment.requirements},
        coordinates={c.path: out[COORDINATE + c.path] for c in experiment.cases.coordinates},
        events={name.split(".")[1]: out[name].astype(np.int64) for name in EVENTS},
        limited=out[LIMITED].astype(np.int64),
        at_limit={use.path: np.where(failed, math.nan, out[cells.AT_LIMIT(use.path)] / steps) for use in watched},
        excess={use.path: np.where(failed, math.nan, out[cells.EXCESS(use.path)]) for use in watched if use.bound},
        extreme_at={
            name: np.where(failed, 0, out[cells.EXTREME_AT(name)]).astype(np.int64) for name in prepared.extremes
        },
        grapples=_grapples(experiment, out, failed),
        warning=warnings,
    )


def _grapples(experiment: Experiment, out: Mapping[str, np.ndarray], failed: np.ndarray) -> dict[str, np.ndarray]:
    """The figures of grapples for `Run`."""
    figures = {}
    for payload in grappled_payloads(experiment.structure):
        never = failed | (out[cells.GRAPPLED(payload, "near")] == 0.0)
        for name in GRAPPLE_FIGURES:
            figures[f"{payload}.{name}"] = np.where(never, math.nan, out[cells.GRAPPLED(payload, name)])
    return figures


def _unanswered(experiment: Experiment, out: Mapping[str, np.ndarray], failed: np.ndarray) -> dict[int, str]:
    """The cases that lack one of their linear answers, with the reasons in words."""
    reasons: dict[int, list[str]] = {}
    for use in experiment.linear:
        why = out.get(WHY_ANSWER + use.name)
        for case in np.flatnonzero(~failed & (why != ANSWERED)).tolist() if why is not None else ():
            reason = WHY_NONE.get(int(why[case]), "") if why is not None else ""
            reasons.setdefault(case, []).append(f"no answer of `{use.name}` {use.where}: {reason}")
    return {case: "; ".join(parts) for case, parts in reasons.items()}


def _misapplied(experiment: Experiment, rows: np.ndarray, out: Mapping[str, np.ndarray]) -> dict[int, str]:
    """The cases that were run with a value other than that of the case table, in words; such a case is a defect."""
    words: dict[int, str] = {}
    for coordinate in experiment.cases.coordinates:
        used, wanted = out[COORDINATE + coordinate.path], coordinate.values[rows]
        for case in np.flatnonzero((used != wanted) & ~(np.isnan(used) & np.isnan(wanted))).tolist():
            words[case] = (
                f"a defect of MET: the engine used {used[case]!r} for {coordinate.path}, and the case table has "
                f"{wanted[case]!r}. Please report it"
            )
    return words


def _met(metric: np.ndarray, comparison: str, limit: float) -> np.ndarray:
    compare = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}[comparison]
    return np.asarray(compare(metric, limit))
