"""Steps of a tuning along slopes: from the best candidate, against the active plants."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from met.optimisers.descent import LocalModel, SlopeDescent
from met.plan.searches import Search
from met.searches.slopes import CaseSlopes, SlopeSource, local_model, worth_of
from met.searches.values import MET


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
        """End the descent."""
        self._descent = None

    def tell(self, candidate: np.ndarray, plants: Sequence[tuple[float, ...]], known: float) -> None:
        """The candidate that was asked for last has been run with these plants. known: its worth"""
        assert self._descent is not None
        away = self._steered_away(known, self._descent.worth)
        self._descent.tell(*((math.inf, None) if away else self._local(candidate, plants)))

    def _steered_away(self, known: float, worth: float) -> bool:
        """True of a candidate that misses the least margin, which steers, beside a worth by the metrics alone that
        misses nothing: slopes of the metrics would lead farther beyond the margin."""
        return self._search.steers and known >= MET > worth

    def _local(self, candidate: np.ndarray, plants: Sequence[tuple[float, ...]]) -> tuple[float, LocalModel | None]:
        """The worth of a candidate, by its metrics between samples, and a local model of the function to minimise."""
        slopes = self._source.slopes(np.array([[*candidate, *plant] for plant in plants]))
        if isinstance(slopes, CaseSlopes):
            model = local_model(self._search, self._source.requirements, slopes, candidate)
            if isinstance(model, LocalModel):
                return worth_of(self._search, self._source.requirements, slopes), model
            self.why_not = model
        else:
            self.why_not = slopes
        return math.inf, None
