"""Differential evolution: a trial moves a member of a population by differences of others, and replaces it if better.

The mutation is current-to-pbest of Zhang and Sanderson, *JADE* (IEEE Trans. Evol. Comput. 13(5), 2009), with constants
drawn for each trial: a search has too few generations to learn them. Values are compared and never calculated with.
"""

from __future__ import annotations

import numpy as np

from met.optimisers.draws import Draws

LEADING = 0.15
"""Share of the population whose members, the best, are the targets of trials."""

WEIGHTS = (0.4, 1.0)
"""Range of the factor by which a trial adds a difference."""

COLLAPSED = 1e-2
"""The population has collapsed where no coordinate spreads by more than this, in edges of the cube."""


class DifferentialEvolution:
    """A population in the unit cube; moves that would leave the cube stop at its walls, so that corners are reached.

    points  [member, dimension];  values [member]
    """

    def __init__(self, draws: Draws, points: np.ndarray, values: np.ndarray) -> None:
        self._draws = draws
        self.points, self.values = np.array(points), np.array(values)
        self._next = 0
        self._members, self._trials = np.zeros(0, np.int64), self.points[:0]

    @property
    def collapsed(self) -> bool:
        """True where the members are so close to each other that trials find nothing new."""
        return bool(np.ptp(self.points, axis=0).max() < COLLAPSED)

    def ask(self, count: int) -> np.ndarray:
        """Trials for the next `count` members, in turn, [count, dimension]."""
        draws, (size, dimension) = self._draws, self.points.shape
        members = (self._next + np.arange(count)) % size
        self._next = (self._next + count) % size
        ranked = np.argsort(self.values, kind="stable")
        leading = self.points[ranked[draws.whole(min(size, max(2, round(LEADING * size))), count)]]
        own = self.points[members]
        other = self.points[(members + 1 + draws.whole(max(1, size - 1), count)) % size]
        another = self.points[draws.whole(size, count)]
        least, most = WEIGHTS
        weight = least + (most - least) * draws.even(count, 1)
        moved = own + weight * (leading - own) + weight * (other - another)
        taken = draws.even(count, dimension) < draws.even(count, 1)
        taken[np.arange(count), draws.whole(dimension, count)] = True
        self._members, self._trials = members, np.clip(np.where(taken, moved, own), 0.0, 1.0)
        return self._trials

    def tell(self, values: np.ndarray) -> None:
        """Take the values of the trials that were asked last, [count]."""
        for member, point, value in zip(self._members, self._trials, values, strict=True):
            if value <= self.values[member]:
                self.points[member], self.values[member] = point, value

    def add(self, point: np.ndarray, value: float) -> None:
        """Replace the worst member by a point found elsewhere, if that is better."""
        worst = int(np.argmax(self.values))
        if value < self.values[worst]:
            self.points[worst], self.values[worst] = point, value
