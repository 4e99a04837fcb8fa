"""A search or a tuning in a plan: the parameters that it may choose, their bounds, and its goal.

Its cases are not known before it has run: each generation follows from the results of the ones before (met/searches).
Until then its case table is its first generation.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from met.diagnostic import Place
from met.frozen import frozen
from met.plan.drawing import drawn_values
from met.unit_parser import parse_unit

MOST_SEARCHED = 1_000_000
"""Largest number of cases of a search."""

MOST_PLANTS = 10_000
"""Largest number of cases of a sweep against which a tuning is judged."""

SHORTEST = 10
"""Smallest number of candidates of a tuning."""


@frozen
class SearchedParameter:
    """A chosen parameter, by its path: its bounds in SI, and the unit in which values are rounded, "" for 1.

    logarithmic  whether equal ratios are equal steps, rather than equal differences
    """

    path: str
    low: float
    high: float
    logarithmic: bool = False
    unit: str = ""

    def values(self, points: np.ndarray) -> np.ndarray:
        """Values in SI at these points of the unit interval, rounded to 12 digits in the deck's unit."""
        measure = parse_unit(self.unit) if self.unit else None
        scale = "loguniform" if self.logarithmic else "uniform"
        return drawn_values(scale, (self.low, self.high), measure, points)


@frozen
class Search:
    """A search or a tuning: its goal, and the bounds of the chosen parameters.

    kind         "search": the case that hurts most; "tune": the parameters that serve best;  of: the run's name
    metric       the goal, and `largest`: whether it is to be that
    parameters   that are chosen; the first coordinates of the cases
    at_most      cases in all
    against      the sweep whose cases a tuning is held against, "" for none; plants: the values of its coordinates in
                 each of them, SI; these are the coordinates behind those that are chosen;  drawn_with: the seed of what
                 it draws
    margin       share of its limit by which a tuning would stay inside each requirement, and of its goal what it would
                 pay for that
    gradients    whether a tuning takes steps along slopes of its metrics, where they have any
    generations  numbers of cases that each generation added to the case table; none before it has run
    along_slopes  how many of its cases were tried along slopes, and `without_slopes`: why there were none where there
                 were none last, in words, empty where there were; as found when it has run
    """

    kind: Literal["search", "tune"]
    metric: str
    largest: bool
    parameters: tuple[SearchedParameter, ...]
    at_most: int
    of: str = ""
    seed: int = 0
    against: str = ""
    plants: tuple[tuple[float, ...], ...] = ()
    drawn_with: int = 0
    margin: float = 0.0
    generations: tuple[int, ...] = ()
    gradients: bool = False
    along_slopes: int = 0
    without_slopes: str = ""
    place: Place | None = None

    @property
    def complete(self) -> bool:
        """True where the case table holds all of its cases, and not only its first generation."""
        return bool(self.generations)

    @property
    def goal(self) -> str:
        """The goal as a deck writes it: `minimise settle`."""
        return f"{'maximise' if self.largest else 'minimise'} {self.metric}"

    def values(self, points: np.ndarray) -> np.ndarray:
        """Values of the chosen parameters, [candidate, parameter], SI, at these points of the unit cube."""
        columns = [each.values(points[:, number]) for number, each in enumerate(self.parameters)]
        return np.stack(columns, axis=1) if len(points) else np.empty((0, len(self.parameters)))

    def generation_of(self, rows: np.ndarray) -> np.ndarray:
        """The number of the generation, from 0, that added each of these rows of the case table."""
        return np.searchsorted(np.cumsum(self.generations), rows, side="right") if self.complete else 0 * rows
