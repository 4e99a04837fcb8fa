"""The decision whether a campaign's experiment is verified, by counts alone: the same for the same campaign
anywhere."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

from batch.campaigns.verification.choosing import most
from batch.campaigns.verification.verifying import FACTORS
from met.plan import Experiment
from met.run import Prepared

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
    steps = _steps(experiment)
    if cases == 1:
        size = _operations(prepared)
        short = size <= SHORT_PROGRAM and size * steps * sum(FACTORS) <= SHORT_OPERATIONS
        return "some" if short else "none"
    added = most(metrics, cases) * sum(FACTORS) * steps + len(FACTORS) * PREPARING
    return "some" if added <= SHARE * cases * steps else "none"


def settled(wanted: Verify, sections: Iterable[tuple[Prepared, int]]) -> Verify:
    """`auto` where the choice equals that of `auto` for each experiment; else the choice itself. So equal campaigns are
    equal however the choice was written."""
    same = all(resolve(wanted, *section) == resolve("auto", *section) for section in sections)
    return "auto" if same else wanted


def _steps(experiment: Experiment) -> int:
    schedule = experiment.structure.schedule
    return schedule.ticks // schedule.dynamics


def _operations(prepared: Any) -> int:
    return sum(len(section.nodes) for section in prepared.recording.sections)
