"""Whether a campaign's experiment is verified, decided by counts alone: the same campaign, the same answer anywhere."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

from batch.campaigns.verification.choosing import most
from batch.campaigns.verification.verifying import FACTORS
from met.plan import Experiment
from met.run import Prepared

Verify = Literal["auto", "none", "some", "all"]

WORDS: tuple[Verify, ...] = ("auto", "none", "some", "all")
"""What may be asked for; `auto` is `some` where that is cheap."""

SHARE = 0.03
"""Of the campaign's steps: so much more is not asked about."""

PREPARING = 250_000
"""Steps of a campaign's cases, side by side in vectors, that take as long as making a program whose machine code is
kept, whatever its size: 12 to 20 ms; measured on the decks shipped."""

SHORT_OPERATIONS, SHORT_PROGRAM = 400_000_000, 15_000
"""Operations of the steps that are added to a single case, about 0.3 s; operations of a program, whose machine code is
made in some seconds and kept: so the error of almost every single case is known without asking."""


def resolve(wanted: Verify, prepared: Prepared, cases: int) -> Verify:
    """`none`, `some` or `all`: what is wanted of so many cases of an experiment; `auto` is `some` where
    the deck requires something of errors by the step, and else settled by what it costs."""
    experiment = prepared.experiment
    metrics = len(experiment.structure.metrics)
    if not metrics or not cases:
        return "none"
    if wanted != "auto":
        return wanted
    if experiment.step_errors:
        return "some"
    steps = _steps(experiment)
    if cases == 1:
        size = _operations(prepared)
        short = size <= SHORT_PROGRAM and size * steps * sum(FACTORS) <= SHORT_OPERATIONS
        return "some" if short else "none"
    added = most(metrics, cases) * sum(FACTORS) * steps + len(FACTORS) * PREPARING
    return "some" if added <= SHARE * cases * steps else "none"


def settled(wanted: Verify, sections: Iterable[tuple[Prepared, int]]) -> Verify:
    """`auto` where what is wanted of each experiment, with so many cases, is what `auto` would do; else what is wanted.
    So a campaign is the same one however that was said."""
    same = all(resolve(wanted, *section) == resolve("auto", *section) for section in sections)
    return "auto" if same else wanted


def _steps(experiment: Experiment) -> int:
    schedule = experiment.structure.schedule
    return schedule.ticks // schedule.dynamics


def _operations(prepared: Any) -> int:
    return sum(len(section.nodes) for section in prepared.recording.sections)
