"""Searches of a plan, step by step: which cases are tried next, from what those before gave.

values   what a case is worth to a search
hardest  a search for the case that hurts most
robust   a tuning against plants, by turns
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from met.plan.searches import Search
from met.searches.hardest import HardestCase
from met.searches.robust import RobustTuning


class SearchMethod(Protocol):
    """The way in which a search goes on: it asks for cases, a generation at a time, each of them once. The cases follow
    from the search and from what it was told alone, to the bit."""

    def ask(self) -> np.ndarray:
        """Coordinates of the next generation's cases, SI, [case, coordinate]; none, when it has ended."""

    def tell(self, values: np.ndarray) -> None:
        """Take what these cases are worth (met/searches/values.py), [case]."""


def search_method(search: Search) -> SearchMethod:
    """The method of a search, at its beginning."""
    return RobustTuning(search) if search.kind == "tune" else HardestCase(search)


__all__ = ["SearchMethod", "search_method"]
