"""A search for the least value in the unit cube by three methods that share a number of points.

Differential evolution follows several basins and reaches corners; division into boxes covers the cube, however many
dimensions mislead the others; CMA-ES polishes the best places that are apart from each other. The finds of the other
two enter the population of differential evolution, and polishing starts from it.
"""

from __future__ import annotations

import math

import numpy as np

from met.optimisers.covariance import CovarianceAdaptation
from met.optimisers.division import BoxDivision
from met.optimisers.draws import Draws
from met.optimisers.evolution import DifferentialEvolution

GENERATIONS = 32
"""Number of generations of a search, unless they would be too small for the processor or larger than useful."""

SMALLEST, LARGEST, LANES = 8, 256, 8
"""Smallest and largest size of a generation, and the number of which it is a multiple."""

BOXES, BOXES_OF_ONE = 0.5, 1.25
"""Largest share of a generation for boxes, and its product with the number of dimensions. Boxes that cover a square do
not begin to cover a cube of 16 dimensions."""

POLISHED = 0.2
"""Share of the remaining points for polishing. With 0.45, searches of functions with several basins ended in lesser
ones more often: of 240 searches in 5, 10 and 16 dimensions, 219 passed 100,000 random points, with 0.2 it was 233."""

POLISHING_STEP, POLISHING_FINEST = 0.1, 1e-3
"""First and last standard deviation of polishing, in edges of the cube."""

APART, ALIKE = 0.1, 0.02
"""Places are apart if some coordinate differs by more than the first; polishing ends within the second of a polished
one."""


class WorstCaseSearch:
    """A search for the least value; it ends when its points are used up, or once it has found -inf."""

    def __init__(self, dimension: int, seed: int, at_most: int) -> None:
        self._dimension, self._left = dimension, at_most
        self._draws = Draws(seed, "hardest")
        self._size = generation(at_most)
        boxes = min(BOXES, BOXES_OF_ONE / dimension)
        self._for_boxes = int(self._size * boxes)
        self._for_polishing = int(self._size * POLISHED * (1 - boxes))
        self._boxes = BoxDivision(dimension)
        self._evolution: DifferentialEvolution | None = None
        self._renewed = False
        self._polishing: CovarianceAdaptation | None = None
        self._polished: list[np.ndarray] = []
        self._points = np.empty((0, dimension))
        self._ends = [0, 0]
        self._best = math.inf

    def ask(self) -> np.ndarray:
        """The next generation: boxes' centres, then points around what is polished, then trials of the population."""
        none = np.empty((0, self._dimension))
        if self._left <= 0 or self._best == -math.inf:
            return none
        size = min(self._size, self._left)
        polished = none
        if self._polishing is not None and self._polishing.population <= size:
            polished = self._polishing.ask()
        rest = size - len(polished)
        if self._evolution is None:
            boxes, self._renewed = self._boxes.ask(1), True
        else:
            boxes = self._boxes.ask(min(rest, self._for_boxes + self._for_polishing - len(polished)))
            self._renewed = self._evolution.collapsed
        rest -= len(boxes)
        if self._evolution is None or self._renewed:
            trials = self._draws.spread(rest, self._dimension)
        else:
            trials = self._evolution.ask(rest)
        self._ends = [len(boxes), len(boxes) + len(polished)]
        self._points = np.concatenate([boxes, polished, trials])
        self._left -= size
        return self._points

    def tell(self, values: np.ndarray) -> None:
        """Learn from the values of the points that were asked last."""
        self._best = min(self._best, float(values.min()))
        of_boxes, of_polished, of_trials = np.split(values, self._ends)
        boxes, polished, trials = np.split(self._points, self._ends)
        self._boxes.tell(of_boxes)
        if self._polishing is not None and len(of_polished):
            self._polishing.tell(of_polished)
        if self._evolution is None:
            self._evolution = DifferentialEvolution(self._draws, self._points, values)
        elif self._renewed:
            if len(trials):
                self._evolution = DifferentialEvolution(self._draws, trials, of_trials)
        else:
            self._evolution.tell(of_trials)
        for points, its in ((boxes, of_boxes), (polished, of_polished)):
            if len(its) and len(its) < len(values):
                least = int(np.argmin(its))
                self._evolution.add(points[least], float(its[least]))
        self._choose_polishing(self._evolution)

    def _choose_polishing(self, evolution: DifferentialEvolution) -> None:
        """Go on polishing until that has converged, or comes to a polished place; then continue with the best member
        that is apart from all polished ones. If there is none, boxes get the points."""
        going = self._polishing
        if going is not None:
            ended = going.converged
            if ended:
                self._polished.append(going.mean)
            elif all(distance(going.mean, place) >= ALIKE for place in self._polished):
                return
        self._polishing = None
        if self._for_polishing < 4:
            return
        for member in np.argsort(evolution.values, kind="stable"):
            point = evolution.points[member]
            if all(distance(point, place) > APART for place in self._polished):
                self._polishing = CovarianceAdaptation(
                    self._draws, point, POLISHING_STEP, POLISHING_FINEST, self._for_polishing
                )
                return


def distance(point: np.ndarray, other: np.ndarray) -> float:
    """The largest difference of a coordinate."""
    return float(np.abs(point - other).max())


def generation(at_most: int) -> int:
    """The number of points of a generation, for a search with this many in all."""
    return max(SMALLEST, min(LARGEST, at_most // GENERATIONS // LANES * LANES))
