"""CMA-ES with restarts, within a total number of candidates."""

from __future__ import annotations

import numpy as np

from met.optimisers.arithmetic import Draws
from met.optimisers.covariance import CovarianceAdaptation

STEP = 0.2
"""The first standard deviation, in edges of the cube. With 0.3 and 3,200 candidates, results in 16 dimensions were
worse: most points were beyond a wall."""

FINEST = 1e-7
"""The search has converged where no standard deviation is larger than this, in edges of the cube."""

GENERATIONS = 100
"""Number of generations of a start, where the candidates suffice for generations that are not too small."""

LARGEST = 64
"""Largest number of candidates of a first generation: more are better spent on further generations."""

LANES = 8
"""The size of a generation is a multiple of this: so many cases are computed at once."""


class RestartedAdaptation:
    """CMA-ES from the middle of the unit cube; after it has converged, again from a random point with twice the
    population (Auger and Hansen, *A Restart CMA Evolution Strategy*, CEC 2005)."""

    def __init__(self, dimension: int, seed: int, at_most: int) -> None:
        self._dimension, self._left = dimension, at_most
        self._draws = Draws(seed, "tuner")
        self._population = first_population(dimension, at_most)
        self._start = self._start_at(np.full(dimension, 0.5))

    def _start_at(self, mean: np.ndarray) -> CovarianceAdaptation:
        return CovarianceAdaptation(self._draws, mean, STEP, FINEST, self._population)

    def ask(self) -> np.ndarray:
        """The next generation; the last one is as large as the remaining number of candidates."""
        if self._left <= 0:
            return np.empty((0, self._dimension))
        if self._start.converged:
            self._population *= 2
            self._start = self._start_at(self._draws.even(self._dimension))
        points = self._start.ask()[: self._left]
        self._left -= len(points)
        return points

    def tell(self, values: np.ndarray) -> None:
        """Learn from the values of a whole generation; one that was cut short is the last, and teaches nothing."""
        if len(values) == self._start.population:
            self._start.tell(values)


def first_population(dimension: int, at_most: int) -> int:
    """The number of candidates of a generation: at least about 4 + 3 log(dimension), as in the tutorial."""
    least = 4 + 2 * (dimension - 1).bit_length()
    wanted = max(least, min(at_most // GENERATIONS, LARGEST))
    return -(-wanted // LANES) * LANES
