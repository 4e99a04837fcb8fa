"""A search for the least value in the unit cube by three methods that share a number of points.

Differential evolution follows several basins and reaches corners; division into boxes covers the cube, however many
dimensions mislead the others; CMA-ES polishes the best places that are apart from each other. The finds of the other
two enter the population of differential evolution, and polishing starts from it.

The mutation of differential evolution is current-to-pbest of Zhang and Sanderson, *JADE* (IEEE Trans. Evol. Comput.
13(5), 2009), with constants drawn for each trial: a search has too few generations to learn them. Values are compared
and never calculated with.

Division is after Jones, Perttunen and Stuckman, *Lipschitzian Optimization Without the Lipschitz Constant* (JOTA 79(1),
1993), with two changes. Boxes of every size are cut, the best of each (Baker et al., *Aggressive DIRECT*, HPC 2000),
rather than those on a convex hull of values: so values are only compared, and a batch can have any size. And a box is
cut along one of its longest edges, the one that was cut least often (Jones, *DIRECT*, Encyclopedia of Optimization,
2001).
"""

from __future__ import annotations

import math

import numpy as np

from met.optimisers.arithmetic import Draws
from met.optimisers.covariance import CovarianceAdaptation

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


FINEST = 6
"""Largest number of times that an edge is cut: detail below 3^-6 of the cube's edge is left to polishing."""


class BoxDivision:
    """Boxes that fill the unit cube, each with the value of its centre. The first is the cube itself."""

    def __init__(self, dimension: int) -> None:
        self._dimension = dimension
        self._centres: list[np.ndarray] = []
        self._cuts: list[np.ndarray] = []
        self._values: list[float] = []
        self._of_size: dict[int, list[int]] = {}
        """The boxes by the number of times they were cut."""
        self._cut_along = np.zeros(dimension, np.int64)
        self._batch: list[tuple[np.ndarray, np.ndarray]] = []

    def ask(self, count: int) -> np.ndarray:
        """Centres of new boxes, [centre, dimension]: at most `count`, two for each box that is cut."""
        self._batch = []
        if not self._centres:
            self._batch = [(np.full(self._dimension, 0.5), np.zeros(self._dimension, np.int64))][:count]
        cutting = bool(self._centres)
        while cutting and len(self._batch) + 2 <= count:
            cutting = self._cut_round(count)
        return np.array([centre for centre, _ in self._batch]).reshape(-1, self._dimension)

    def _cut_round(self, count: int) -> bool:
        """Cut, for each size, the best boxes, as many as the square root of their number; False where there is nothing
        to cut."""
        before = len(self._batch)
        for size in sorted(self._of_size):
            if size >= FINEST * self._dimension:
                continue
            boxes = self._of_size[size]
            boxes.sort(key=lambda box: (self._values[box], box))
            number = min(math.isqrt(max(len(boxes) - 1, 0)) + 1, (count - len(self._batch)) // 2, len(boxes))
            best, self._of_size[size] = boxes[:number], boxes[number:]
            for box in best:
                self._cut(box)
        return len(self._batch) > before

    def _cut(self, box: int) -> None:
        """Cut a box into three along its longest edge, and ask for the values at the centres of the two outer ones."""
        cuts = self._cuts[box].copy()
        longest = np.flatnonzero(cuts == cuts.min())
        along = int(longest[np.argmin(self._cut_along[longest])])
        self._cut_along[along] += 1
        cuts[along] += 1
        third = 1.0 / 3 ** int(cuts[along])
        for side in (-third, third):
            centre = self._centres[box].copy()
            centre[along] += side
            self._batch.append((centre, cuts))
        self._cuts[box] = cuts
        self._of_size.setdefault(int(cuts.sum()), []).append(box)

    def tell(self, values: np.ndarray) -> None:
        """Take the values of the centres that were asked last, [centre]."""
        for (centre, cuts), value in zip(self._batch, values, strict=True):
            self._of_size.setdefault(int(cuts.sum()), []).append(len(self._centres))
            self._centres.append(centre)
            self._cuts.append(cuts)
            self._values.append(float(value))


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
