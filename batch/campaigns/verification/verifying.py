"""Verification runs: chosen cases again with shorter steps of the dynamics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from batch.archive.verified import Verified
from met import models
from met import run as engine
from met.analysis.refinement import refine
from met.plan import Experiment
from met.plan.channel import channels
from met.plan.judged import MetricUse
from met.program.system import FURTHEST

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
