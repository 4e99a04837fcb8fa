"""CMA-ES: points are drawn around a mean, with a covariance that is learnt from the best of them.

From Hansen, *The CMA Evolution Strategy: A Tutorial* (arXiv:1604.00772): cumulative step-size adaptation, rank-one and
rank-mu update with negative weights, constants of its table 1. The covariance is C = A A' with A lower triangular, as
in Krause, Arbonès and Igel, *CMA-ES with Optimal Covariance Update and Storage Complexity* (NeurIPS 2016), so that no
eigenvalues are needed. Values are compared and never calculated with: infinite ones, penalties and scales do no harm.
"""

from __future__ import annotations

import math

import numpy as np

from met.optimisers.arithmetic import Draws, added, growth, logarithm, lower_factor, power, total, transformed

WIDEST = 1.0
"""The largest step, in edges of the cube: with it, points are practically uniform in the cube."""

WIDENING = 1.5
"""Factor by which the step grows where all points of a generation are equally good."""

WORST_CONDITION = 1e14
"""Largest squared ratio of A's diagonal: beyond, rounding spoils the covariance."""

PATIENCE = 50
"""Number of generations without a better value after which a start has converged; 30 points a dimension are added to
it."""


class CovarianceAdaptation:
    """One start of CMA-ES in the unit cube, whose walls reflect: points beyond a wall are mirrored at it.

    Mirrored rather than moved onto the wall or drawn again: of these three it alone reached corners of the cube with
    2,000 points in 8 and 16 dimensions.

    mean        [dimension], where it starts;  step: its first standard deviation, in edges of the cube
    finest      the largest standard deviation at which it has converged
    population  points of a generation, at least 4
    """

    def __init__(self, draws: Draws, mean: np.ndarray, step: float, finest: float, population: int) -> None:
        n = len(mean)
        self._draws, self._finest, self.population = draws, finest, population
        self._mean, self._step = np.array(mean, float), step
        self._factor, self._covariance = np.eye(n), np.eye(n)
        self._path, self._step_path = np.zeros(n), np.zeros(n)
        self._generation = 0
        self._best, self._unimproved = math.inf, 0
        self._degenerate = False
        self._drawn = np.zeros((0, n))
        self._set_rates(n)

    def _set_rates(self, n: int) -> None:
        """Set the weights and rates of learning for `n` dimensions, by Hansen's table 1."""
        count = self.population
        raw = np.array([logarithm((count + 1) / 2) - logarithm(rank + 1) for rank in range(count)])
        positive, negative = np.maximum(raw, 0.0), np.minimum(raw, 0.0)
        mass = total(positive) ** 2 / total(positive**2)
        negative_mass = total(negative) ** 2 / total(negative**2)
        self._mass = mass
        self._path_rate = (4 + mass / n) / (n + 4 + 2 * mass / n)
        self._step_rate = (mass + 2) / (n + mass + 5)
        self._damping = 1 + 2 * max(0.0, math.sqrt((mass - 1) / (n + 1)) - 1) + self._step_rate
        one_rate = 2 / ((n + 1.3) * (n + 1.3) + mass)
        mu = min(1 - one_rate, 2 * (mass - 2 + 1 / mass) / ((n + 2) * (n + 2) + mass))
        most = min(1 + one_rate / mu, 1 + 2 * negative_mass / (mass + 2), (1 - one_rate - mu) / (n * mu))
        self._one_rate, self._mu_rate = one_rate, mu
        self._gains, self._losses = positive / total(positive), -negative / total(negative) * most
        self._usual_length = math.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n))

    @property
    def mean(self) -> np.ndarray:
        """The point of the cube around which it draws, [dimension]."""
        return mirrored(self._mean)

    @property
    def converged(self) -> bool:
        """True where further generations are useless: all steps are small, or no better value has come for long."""
        n = len(self._mean)
        deviation = self._step * math.sqrt(float(self._covariance.diagonal().max()))
        patience = PATIENCE + 30 * n / self.population
        return self._degenerate or deviation < self._finest or self._unimproved > patience

    def ask(self) -> np.ndarray:
        """The points of the next generation, [population, dimension]."""
        self._drawn = self._draws.nearly_normal(self.population, len(self._mean))
        return mirrored(self._mean + self._step * transformed(self._factor, self._drawn))

    def tell(self, values: np.ndarray) -> None:
        """Learn from the values of the points that were asked last, [population]."""
        least = float(values.min())
        self._unimproved = 0 if least < self._best else self._unimproved + 1
        self._best = min(least, self._best)
        if least == values.max():
            self._step = min(self._step * WIDENING, WIDEST)
            return
        self._generation += 1
        gains, losses = (shared_weights(weights, values) for weights in (self._gains, self._losses))
        moves = transformed(self._factor, self._drawn)
        chosen = gains[:, None]
        move = added(chosen * moves)
        self._mean = self._mean + self._step * move
        length = self._lengthen_step_path(added(chosen * self._drawn))
        steady = self._lengthen_path(move, length)
        self._learn(gains, losses, moves, steady)
        change = self._step_rate / self._damping * (length / self._usual_length - 1)
        self._step = min(self._step * growth(min(change, 1.0)), WIDEST)

    def _lengthen_step_path(self, drawn: np.ndarray) -> float:
        """The length of the step's path with the last mean of what was drawn."""
        rate = self._step_rate
        self._step_path = (1 - rate) * self._step_path + math.sqrt(rate * (2 - rate) * self._mass) * drawn
        return math.sqrt(total(self._step_path * self._step_path))

    def _lengthen_path(self, move: np.ndarray, length: float) -> bool:
        """Add a move to the covariance's path; returns False while the step grows so quickly that the path stalls."""
        n, rate = len(move), self._path_rate
        usual = math.sqrt(1 - power(1 - self._step_rate, 2 * self._generation)) * self._usual_length
        steady = length < (1.4 + 2 / (n + 1)) * usual
        self._path = (1 - rate) * self._path
        if steady:
            self._path = self._path + math.sqrt(rate * (2 - rate) * self._mass) * move
        return steady

    def _learn(self, gains: np.ndarray, losses: np.ndarray, moves: np.ndarray, steady: bool) -> None:
        """Update the covariance from the moves of a generation, with the weights of better and worse ones."""
        n, one_rate, mu = len(self._mean), self._one_rate, self._mu_rate
        squares = added((self._drawn * self._drawn).T)
        scaled = gains + losses * n / np.maximum(squares, 1e-300)
        lost = 0.0 if steady else one_rate * self._path_rate * (2 - self._path_rate)
        self._covariance = (
            (1 + lost - one_rate - mu * total(gains + losses)) * self._covariance
            + one_rate * self._path[:, None] * self._path[None, :]
            + mu * added(scaled[:, None, None] * moves[:, :, None] * moves[:, None, :])
        )
        factor = lower_factor(self._covariance)
        if factor is None:
            self._degenerate = True
            return
        self._factor = factor
        edges = factor.diagonal()
        self._degenerate = bool(edges.max() ** 2 > WORST_CONDITION * edges.min() ** 2)


def mirrored(points: np.ndarray) -> np.ndarray:
    """Points of the whole space reflected into the unit cube at its walls."""
    folded = points - 2.0 * np.floor(points / 2.0)
    return np.asarray(np.minimum(folded, 2.0 - folded))


def shared_weights(weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The weight of each value by its rank, the least first; equal values share their weights, so that a plateau has no
    direction."""
    order = np.argsort(values, kind="stable")
    ranked = values[order]
    starts = np.flatnonzero(np.concatenate([[True], ranked[1:] != ranked[:-1]])).tolist()
    out = np.empty(len(values))
    for first, last in zip(starts, [*starts[1:], len(values)], strict=True):
        out[order[first:last]] = total(weights[first:last]) / (last - first)
    return out


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
