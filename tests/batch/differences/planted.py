"""Two archives of the same cases in another order, into whose second one changes are planted, each known exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
from met import run as engine
from met.plan import Experiment
from met.run import Run
from tests.batch import plans

CASES = 300

Plant = Callable[[Run, dict[int, int]], None]
"""Changes a run's results; where each case of the first archive lies in it, by its position there."""


def shuffled(experiment: Experiment, order: Sequence[int]) -> Experiment:
    """The same cases in another order of the case table."""
    coordinates = tuple(replace(c, values=c.values[list(order)]) for c in experiment.cases.coordinates)
    return replace(experiment, cases=replace(experiment.cases, count=len(order), coordinates=coordinates))


def two(
    monkeypatch: pytest.MonkeyPatch,
    folder: Path,
    order: Sequence[int],
    plant: Plant | None = None,
    change: Callable[[Experiment], Experiment] = lambda each: each,
    cases: int = CASES,
) -> tuple[Path, Path]:
    """Archives a and b. order: positions in a of b's cases; plant: into b's results; change: of b's experiment."""
    plans.answering(monkeypatch)
    experiment = plans.gains(cases)
    batch.run(plans.plan(experiment), output=folder / "a.h5", histories="all")

    def answer(asked: Experiment, rows: Any = None, **options: Any) -> Run:
        found: Run = plans.answer(asked, rows, **options)
        if plant is not None:
            place = {int(order[row]): i for i, row in enumerate(found.case.tolist())}
            plant(found, place)
        return found

    monkeypatch.setattr(engine, "run", answer)
    batch.run(plans.plan(change(shuffled(experiment, order))), output=folder / "b.h5", histories="all")
    return folder / "a.h5", folder / "b.h5"


def order(seed: int, cases: int = CASES) -> list[int]:
    found: list[int] = np.random.default_rng(seed).permutation(cases).tolist()
    return found
