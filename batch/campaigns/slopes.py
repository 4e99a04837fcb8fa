"""Slopes of a tuning's metrics, by the program that runs with tangents beside it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from batch.campaigns.points import with_cases
from met.analysis.linear.gradient import FAILED, GradientProgram
from met.diagnostic import Problem
from met.plan import Experiment
from met.plan.judged import Requirement
from met.searches.slopes import CaseSlopes


class TuningSlopes:
    """See `SlopeSource`. The program is compiled when slopes are first asked for.

    What it gives follows from the cases alone, to the bit, so a tuning that goes on asks for the same cases again.
    """

    def __init__(self, experiment: Experiment) -> None:
        assert experiment.search is not None
        self._experiment, self._search = experiment, experiment.search
        names = (self._search.metric, *(each.metric for each in experiment.requirements))
        self._metrics = tuple(dict.fromkeys(names))

    @property
    def requirements(self) -> Sequence[Requirement]:
        """Of the run, as each case is held against them."""
        return self._experiment.requirements

    @cached_property
    def _program(self) -> GradientProgram:
        return GradientProgram(self._experiment, len(self._search.parameters))

    def slopes(self, cases: np.ndarray) -> CaseSlopes | str:
        """See `SlopeSource`."""
        experiment = with_cases(self._experiment, cases)
        try:
            found = self._program.of(range(len(cases)), self._metrics, experiment=experiment, edges=False)
        except Problem as refused:
            return refused.diagnostics[0].message
        done, why_not = np.ones(len(cases), dtype=bool), dict[str, str]()
        for (case, metric, _), why in found.why_not.items():
            name = found.metrics[metric]
            done[case] &= why != FAILED
            why_not.setdefault(name, f"`{name}`: {why}")
        values = dict(zip(found.metrics, found.value.T, strict=True))
        slopes = {name: found.slope[:, number] for number, name in enumerate(found.metrics)}
        return CaseSlopes(done, values, slopes, why_not)
