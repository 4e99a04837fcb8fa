"""Differential evolution, a generation at a time: rand/1/bin of Storn and Price (J. Global Optimization 11 (1997) 341).

Every trial point is a member of the population moved along the difference of two others; it takes the place of the
member that it was crossed with where it is no worse.
"""

from __future__ import annotations

import numpy as np

STEP, CROSSED = 0.6, 0.9
"""Length of a step along a difference, and share of a trial's numbers that come from it."""

MOST_MEMBERS, EACH = 40, 8
"""Members of a population at most, and for each dimension."""


class Evolution:
    """Differential evolution in the unit cube, at most so many points in all; the first is `start` where it is given.

    It ends when its points are spent, or when all members are as good as equal.
    """

    def __init__(self, dimension: int, seed: int, at_most: int, start: np.ndarray | None = None) -> None:
        self._random = np.random.Generator(np.random.PCG64([seed, dimension, at_most]))
        self._dimension, self._left = dimension, at_most
        members = max(4, min(MOST_MEMBERS, EACH * dimension, at_most))
        rows = [self._random.permutation(members) for _ in range(dimension)]
        cells = np.stack(rows, axis=1) + self._random.random((members, dimension))
        self._members = cells / members
        if start is not None:
            self._members[0] = start
        self._values = np.full(members, np.nan)
        self._asked = np.empty((0, dimension))

    def ask(self) -> np.ndarray:
        """See `Optimiser`."""
        if np.isnan(self._values).all():
            trials = self._members
        elif self._converged():
            trials = np.empty((0, self._dimension))
        else:
            trials = self._trials()
        self._asked = trials[: self._left]
        return self._asked.copy()

    def tell(self, values: np.ndarray) -> None:
        """See `Optimiser`."""
        count = len(values)
        self._left -= count
        better = np.isnan(self._values[:count]) | (values <= self._values[:count])
        self._members[:count][better] = self._asked[better]
        self._values[:count][better] = values[better]

    def _converged(self) -> bool:
        return bool(np.ptp(self._members, axis=0).max() < 1e-9)

    def _trials(self) -> np.ndarray:
        members = self._members
        count = len(members)
        trials = np.empty_like(members)
        for own in range(count):
            a, b, c = self._random.choice(count - 1, 3, replace=False)
            a, b, c = (other + (other >= own) for other in (a, b, c))
            moved = members[a] + STEP * (members[b] - members[c])
            taken = self._random.random(self._dimension) < CROSSED
            taken[self._random.integers(self._dimension)] = True
            trials[own] = np.where(taken, moved, members[own])
        folded = np.abs(trials) % 2.0
        return np.where(folded > 1.0, 2.0 - folded, folded)
