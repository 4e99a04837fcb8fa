"""Verification runs: chosen cases again with shorter steps of the dynamics."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from batch.archive.verified import Verified
from batch.campaigns.outcomes import CaseOutcomes
from met import models
from met import run as engine
from met.analysis.step_error import refine
from met.distinct import distinct
from met.plan import Experiment
from met.plan.channel import channels
from met.plan.judged import MetricUse
from met.program.system import FURTHEST
from met.run import Prepared

SEEDED = 2
"""Number of cases that the seed chooses among all."""


def chosen(experiment: Experiment, results: CaseOutcomes) -> np.ndarray:
    """Places of the cases to verify, rising, among those that reached their end: the first, the last, the worst of each
    metric, and `SEEDED` more by the seed of the experiment's noise. None where no case did."""
    ends = results.ends()
    if ends is None:
        return np.zeros(0, np.int64)
    places = [*ends, *results.worst_finite()]
    for number in range(SEEDED):
        left = results.done.set - len(set(places))
        if left:
            digest = hashlib.sha256(f"verified {experiment.cases.seed} {number}".encode()).digest()
            places.append(_done_beside(results, places, int.from_bytes(digest[:8], "big") % left))
    return distinct(np.array(places, np.int64))


def _done_beside(results: CaseOutcomes, places: list[int], number: int) -> int:
    """The case of this number among those that reached their end, not counting these places, all of which did."""
    ranks = np.sort(results.done.rank(distinct(np.array(places, np.int64))))
    for rank in ranks.tolist():
        number += rank <= number
    return int(results.done.select(np.array([number]))[0])


def most(metrics: int, cases: int) -> int:
    """The largest number of cases that `chosen` chooses from this many cases with these metrics."""
    return min(cases, 2 + metrics + SEEDED)


Verify = Literal["auto", "none", "some", "all"]

WORDS: tuple[Verify, ...] = ("auto", "none", "some", "all")
"""Allowed choices; `auto` is `some` where that is cheap."""

SHARE = 0.03
"""Share of the campaign's steps up to which verification is always cheap enough."""

PREPARING = 250_000
"""Number of steps of a campaign's cases, in vectors side by side, that takes as long as recording a program with cached
machine code, whatever its size: 12 to 20 ms; measured on the shipped decks."""

SHORT_OPERATIONS, SHORT_PROGRAM = 400_000_000, 15_000
"""Largest number of operations of the steps added for a single case, about 0.3 s, and of a program's operations, whose
machine code takes some seconds once: so almost every single case gets its errors by default."""


def resolve(wanted: Verify, prepared: Prepared, cases: int) -> Verify:
    """`none`, `some` or `all`: the resolved choice for this many cases of an experiment; `auto` is `some` where the
    deck limits errors due to the step, and otherwise decided by cost."""
    experiment = prepared.experiment
    metrics = len(experiment.structure.metrics)
    if not metrics or not cases:
        return "none"
    if wanted != "auto":
        return wanted
    if experiment.step_errors:
        return "some"
    steps = experiment.structure.schedule.ticks // experiment.structure.schedule.dynamics
    if cases == 1:
        size = sum(len(section.nodes) for section in prepared.recording.sections)
        short = size <= SHORT_PROGRAM and size * steps * sum(FACTORS) <= SHORT_OPERATIONS
        return "some" if short else "none"
    added = most(metrics, cases) * sum(FACTORS) * steps + len(FACTORS) * PREPARING
    return "some" if added <= SHARE * cases * steps else "none"


FACTORS = (2, 4)
"""Numbers of steps in place of one: a verified case takes 2 + 4 times its own steps in addition."""


def verify(
    experiment: Experiment,
    rows: np.ndarray,
    names: dict[str, str],
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Verified:
    """Run these rows of the case table at half and a quarter of the step; servos, sensors, beds and noise tick as they
    did.

    names     of the metrics' variables in the archive, by the metrics' own
    progress  called with the number of runs done so far, of `len(FACTORS)` for each row
    """
    structure = experiment.structure
    metrics = {}
    for number, factor in enumerate(FACTORS):
        progress_of_run = progress and partial(_add, progress, number * len(rows))
        refined = refine(experiment, factor)
        metrics[factor] = _metrics(refined, rows, threads, progress_of_run, furthest=factor == FACTORS[-1])
    half, quarter = (np.stack([metrics[factor][name] for name in names], axis=1) for factor in FACTORS)
    last = metrics[FACTORS[-1]]
    furthest = np.stack([last.get(name + FURTHEST, last[name]) for name in names], axis=1)
    seen = np.array([_is_seen_at_steps(experiment, name) for name in names])
    missed = np.subtract(furthest, quarter, out=np.zeros(quarter.shape), where=seen & (furthest != quarter))
    return Verified(
        cases=experiment.cases.table[rows],
        metrics=tuple(names.values()),
        half=half,
        quarter=quarter,
        instant=np.array([_instant(experiment, name) for name in names]),
        missed=np.abs(missed),
        order=models.find("integrator", structure.integrator).order,
        step=structure.schedule.step,
    )


def _add(progress: Callable[[int], None], before: int, done: int) -> None:
    progress(before + done)


def _metrics(
    refined: Experiment,
    rows: np.ndarray,
    threads: int | None,
    progress: Callable[[int], None] | None,
    *,
    furthest: bool,
) -> dict[str, np.ndarray]:
    """The metrics of these rows, with the furthest values between samples where it is `furthest`. Nothing is recorded,
    so that the program is as small as it can be."""
    bare = engine.Prepared(replace(refined, structure=replace(refined.structure, record=())), furthest=furthest)
    return engine.run(bare, rows, threads=threads, record=False, progress=progress).metrics


def _instant(experiment: Experiment, name: str) -> float:
    """A quarter of the step, s, where a metric is an instant that is seen at whole steps; else 0."""
    use = _use(experiment, name)
    of_time = models.find("metric", use.model, use.place).unit == "s"
    return experiment.structure.schedule.step / FACTORS[-1] if of_time and _is_seen_at_steps(experiment, name) else 0.0


def _is_seen_at_steps(experiment: Experiment, name: str) -> bool:
    """True where a metric sees its channel at each step. One of a servo's memory sees it at the servo's ticks, which do
    not change."""
    structure, path = experiment.structure, _use(experiment, name).of
    return channels(structure, [path])[path].divisor == structure.schedule.dynamics


def _use(experiment: Experiment, name: str) -> MetricUse:
    return next(metric for metric in experiment.structure.metrics if metric.name == name)
