"""Slopes of a tuning's metrics, by the program with tangents."""

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
    """Slopes of a campaign's tuning (`SlopeSource`). The program is compiled when slopes are first asked for.

    The results depend on the cases alone, to the bit, so a resumed tuning asks for the same cases again.
    """

    def __init__(self, experiment: Experiment) -> None:
        assert experiment.search is not None
        self._experiment, self._search = experiment, experiment.search
        names = (self._search.metric, *(requirement.metric for requirement in experiment.requirements))
        self._metrics = tuple(dict.fromkeys(names))

    @property
    def requirements(self) -> Sequence[Requirement]:
        """The run's requirements, by which each case is judged."""
        return self._experiment.requirements

    @cached_property
    def _program(self) -> GradientProgram:
        return GradientProgram(self._experiment, len(self._search.parameters))

    def slopes(self, cases: np.ndarray) -> CaseSlopes | str:
        """The slopes of these cases, or the reason why there are none (`SlopeSource.slopes`)."""
        experiment = with_cases(self._experiment, cases)
        try:
            case_slopes = self._program.of(range(len(cases)), self._metrics, experiment=experiment, edges=False)
        except Problem as refused:
            return refused.diagnostics[0].message
        done, why_not = np.ones(len(cases), dtype=bool), dict[str, str]()
        for (case, metric, _), why in case_slopes.why_not.items():
            name = case_slopes.metrics[metric]
            done[case] &= why != FAILED
            why_not.setdefault(name, f"`{name}`: {why}")
        values = dict(zip(case_slopes.metrics, case_slopes.value.T, strict=True))
        slopes = {name: case_slopes.slope[:, number] for number, name in enumerate(case_slopes.metrics)}
        return CaseSlopes(done, values, slopes, why_not)
