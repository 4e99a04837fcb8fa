"""Slopes of the metrics of a tuning's cases, and the function to minimise in a form for descent.

The worth of a case (met/searches/values.py) falls and rises in tiers. Within a tier it consists of smooth functions of
the parameters, with hinges on them: the missing share of a margin, a distance beyond a limit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from met.frozen import frozen
from met.optimisers.arithmetic import logarithm
from met.optimisers.descent import LocalModel, SlopeDescent
from met.plan.searches import Search
from met.searches.values import MET, MetricLimit, served

PENALTY = 100.0
"""Weight, relative to the goal, of a limit that is missed by all of itself: so large that a step does not go beyond
one."""

WITHIN = 1e-6
"""The share of a limit that a step keeps from it at least, so that rounded values do not lie beyond."""


@frozen
class CaseSlopes:
    """Metrics of cases, and their derivatives by the chosen parameters, SI.

    done     [case]: whether it reached its end;  values: by name, [case], as they are between samples
    slopes   by name, [case, parameter]; not-a-number where there is none
    why_not  by name, why there is none in any of the cases
    """

    done: np.ndarray
    values: Mapping[str, np.ndarray]
    slopes: Mapping[str, np.ndarray]
    why_not: Mapping[str, str]


class SlopeSource(Protocol):
    """Source of slopes of a tuning's cases, with the requirements on them."""

    @property
    def requirements(self) -> Sequence[MetricLimit]:
        """The requirements on the metrics."""

    def slopes(self, cases: np.ndarray) -> CaseSlopes | str:
        """The slopes of these cases, [case, coordinate], SI; or the reason why there are none."""


def worth_of(search: Search, requirements: Sequence[MetricLimit], case_slopes: CaseSlopes) -> float:
    """The worth of a candidate as that of the worst of these cases, by what its metrics are between samples."""
    goal = case_slopes.values[search.metric]
    return float(
        served(goal, search.largest, case_slopes.done, requirements, case_slopes.values, search.margin).max(
            initial=-math.inf
        )
    )


def local_model(
    search: Search, requirements: Sequence[MetricLimit], case_slopes: CaseSlopes, candidate: np.ndarray
) -> LocalModel | str:
    """A local model, over the unit cube, of the function to minimise near a candidate; or the reason why there is none.

    candidate  values of its parameters, SI;  case_slopes: of its cases
    """
    if not case_slopes.done.all():
        return "a case fails"
    per_share = np.array([_per_share(parameter.low, parameter.high, parameter.logarithmic, value)
                          for parameter, value in zip(search.parameters, candidate, strict=True)])  # fmt: skip
    sign = -1.0 if search.largest else 1.0
    goal = sign * case_slopes.values[search.metric]
    goal_slopes = sign * case_slopes.slopes[search.metric] * per_share
    count, dimension = goal_slopes.shape
    misses = worth_of(search, requirements, case_slopes) >= 1.0
    if not np.isfinite(goal).all():
        return f"`{search.metric}` has no value"
    if misses:
        goal, goal_slopes = np.zeros(count), np.zeros((count, dimension))
    elif not np.isfinite(goal_slopes).all():
        return case_slopes.why_not.get(search.metric, f"`{search.metric}` has no slope")
    hinges, slopes, weights = [np.zeros(0)], [np.zeros((0, dimension))], [np.zeros(0)]
    for requirement in requirements:
        values = case_slopes.values[requirement.metric]
        if not np.isfinite(values).all():
            return f"`{requirement.metric}` has no value"
        falls = -1.0 if requirement.comparison.startswith("<") else 1.0
        size = abs(requirement.limit) or 1.0
        out = -falls * case_slopes.slopes[requirement.metric] * per_share / size
        beyond = -falls * (values - requirement.limit) / size
        far = beyond < -max(2.0 * search.margin, 10.0 * WITHIN)
        if not np.isfinite(out).all(axis=1)[~far].all():
            return case_slopes.why_not.get(requirement.metric, f"`{requirement.metric}` has no slope")
        out = np.where(np.isfinite(out), out, 0.0)
        keep = WITHIN + (0.5 * search.margin if misses else 0.0)
        hinges.append(beyond + keep)
        slopes.append(out)
        weights.append(np.full(count, 1.0) if misses else PENALTY * np.maximum(np.abs(goal), 1e-12))
        if search.margin > 0.0 and requirement.limit != 0.0 and not misses:
            hinges.append(1.0 + beyond / search.margin)
            slopes.append(out / search.margin)
            weights.append(np.abs(goal) * search.margin)
    pieces = np.tile(np.arange(count), len(hinges) - 1)
    return LocalModel(
        goal, goal_slopes, np.concatenate(hinges), np.concatenate(slopes), pieces, np.concatenate(weights)
    )


def _per_share(low: float, high: float, logarithmic: bool, value: float) -> float:
    """Slope of a parameter by its place in its range, at this value."""
    return value * logarithm(high / low) if logarithmic else high - low


class SlopeSteps:
    """Candidates along slopes, one at a time, while there are slopes.

    cases    cases that were asked for so far;  why_not: why there was no slope where there was none last, in words
    settled  whether the last descent ended where its slopes promised nothing more
    """

    def __init__(self, search: Search, source: SlopeSource) -> None:
        self._search, self._source = search, source
        self._descent: SlopeDescent | None = None
        self.cases, self.why_not, self.settled = 0, "", False

    @property
    def going(self) -> bool:
        """True while a descent goes on."""
        return self._descent is not None

    def begin(
        self, point: np.ndarray, candidate: np.ndarray, plants: Sequence[tuple[float, ...]], known: float
    ) -> None:
        """Begin at a point of the unit cube, with the values there, SI, if there are slopes. known: its worth"""
        worth, model = self._local(candidate, plants)
        if self._steered_away(known, worth):
            model, self.why_not = None, "the least margin has no slopes"
        self.settled = False
        self._descent = None if model is None else SlopeDescent(point, worth, model)

    def ask(self) -> np.ndarray:
        """The next point of the unit cube, [1, parameter]; none, [0, parameter], where the descent has ended."""
        assert self._descent is not None
        points = self._descent.ask()
        if not len(points):
            self.settled = self._descent.converged
            self.end()
        return points

    def end(self) -> None:
        """End the descent along slopes."""
        self._descent = None

    def tell(self, candidate: np.ndarray, plants: Sequence[tuple[float, ...]], known: float) -> None:
        """Take the result of the candidate that `ask` gave last, and make the descent's next step. plants: the cases of
        a tuning that it was run on; known: its worth."""
        assert self._descent is not None
        away = self._steered_away(known, self._descent.worth)
        self._descent.tell(*((math.inf, None) if away else self._local(candidate, plants)))

    def _steered_away(self, known: float, worth: float) -> bool:
        """True of a candidate that misses the least margin, which steers, beside a worth by the metrics alone that
        misses nothing: slopes of the metrics would lead farther beyond the margin."""
        return self._search.steers and known >= MET > worth

    def _local(self, candidate: np.ndarray, plants: Sequence[tuple[float, ...]]) -> tuple[float, LocalModel | None]:
        """The worth of a candidate by its metrics between samples, and a local model of the function that the descent
        minimises."""
        slopes = self._source.slopes(np.array([[*candidate, *plant] for plant in plants]))
        if isinstance(slopes, CaseSlopes):
            model = local_model(self._search, self._source.requirements, slopes, candidate)
            if isinstance(model, LocalModel):
                return worth_of(self._search, self._source.requirements, slopes), model
            self.why_not = model
        else:
            self.why_not = slopes
        return math.inf, None
