"""Searches of a plan, step by step: each generation of cases follows from the results of the ones before.

values   what a case is worth to a search
hardest  a search for the case that hurts most
robust   a tuning against plants, by turns
slopes   metrics' slopes, and what is to be small by them;  slope_steps: a tuning's steps along them
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from met.plan.searches import Search, TuningStart
from met.searches.answer import designs_that_stand
from met.searches.robust import HardestCase, RobustTuning
from met.searches.slopes import SlopeSource


class SearchMethod(Protocol):
    """The method of a search: it asks for cases, a generation at a time and each only once. The cases depend only on
    the search and on the values so far, to the bit."""

    def ask(self) -> np.ndarray:
        """Coordinates of the next generation's cases, SI, [case, coordinate]; empty after the end."""

    def tell(self, values: np.ndarray) -> None:
        """Take the worths of these cases (met/searches/values.py), [case]."""


def search_method(search: Search, source: SlopeSource | None = None) -> SearchMethod:
    """The method of a search, at its beginning. source: of slopes, for a tuning that uses them; None: for its first
    generation only, or for a search without them."""
    if search.kind != "tune":
        return HardestCase(search)
    return RobustTuning(search, source if search.gradients else None)


def steps_of(method: SearchMethod) -> dict[str, Any]:
    """The fields of a `Search` that say which of its cases were tried along slopes; none for a method without
    slopes."""
    steps = method.steps if isinstance(method, RobustTuning) else None
    return {} if steps is None else {"along_slopes": steps.cases, "without_slopes": steps.why_not}


def starts_of(method: SearchMethod, search: Search, table: np.ndarray, worth: np.ndarray) -> tuple[TuningStart, ...]:
    """The starts of a tuning that has ended; none of a search. table: of its cases, [case, coordinate]; worth: [case],
    as the tuning took it"""
    starts = []
    beginnings = (0, *method.beginnings) if isinstance(method, RobustTuning) else ()
    for first, last in zip(beginnings, (*beginnings[1:], len(table)), strict=True) if beginnings else ():
        designs = designs_that_stand(search, table[first:last], worth[first:last])
        starts.append(TuningStart(first, first + int(designs[0][0]) if designs else -1))
    return tuple(starts)


__all__ = ["SearchMethod", "search_method", "starts_of", "steps_of"]
