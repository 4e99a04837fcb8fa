"""Two numbers that cases differ in, as a grid: its levels, whether cases fill it, and which case stands for a cell."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from batch.signals import number_text
from met.distinct import distinct
from met.frozen import frozen

MOST_LEVELS = 48
"""Rows and columns of a map; more values share them, in equal stretches."""

FULL = 0.5
"""A grid has cases in more than this share of its cells: two parameters that go in step make none."""


@frozen
class Levels:
    """Where cases lie along a side of a grid.

    values  the different values, rising; of more than MOST_LEVELS the edges of equal stretches, one more than `texts`
    texts   each level in words
    places  of each case which level it has; -1 where its value is no number
    """

    values: np.ndarray
    texts: tuple[str, ...]
    places: np.ndarray

    @property
    def stretches(self) -> bool:
        """Whether a level is a stretch of values."""
        return len(self.values) > len(self.texts)


def levels(values: np.ndarray) -> np.ndarray:
    """The different values that are numbers, rising."""
    return distinct(values[np.isfinite(values)])


def levelled(values: np.ndarray, words: Sequence[str] = ()) -> Levels:
    """The levels of a column. words: of a choice, what its numbers stand for."""
    found = levels(values)
    finite = np.isfinite(values)
    places = np.full(len(values), -1)
    if len(found) <= MOST_LEVELS:
        places[finite] = np.searchsorted(found, values[finite])
        return Levels(found, tuple(words[int(v)] if words else number_text(float(v)) for v in found), places)
    edges = np.linspace(found[0], found[-1], MOST_LEVELS + 1)
    places[finite] = np.clip(np.searchsorted(edges, values[finite], side="right") - 1, 0, MOST_LEVELS - 1)
    texts = [f"{number_text(float(a))} … {number_text(float(b))}" for a, b in pairwise(edges)]
    return Levels(edges, tuple(texts), places)


def is_grid(x: np.ndarray, y: np.ndarray) -> bool:
    """Whether most of the combinations of two parameters' values are among the cases."""
    good = np.isfinite(x) & np.isfinite(y)
    x_levels, y_levels = levels(x), levels(y)
    if len(x_levels) < 2 or len(y_levels) < 2 or len(x_levels) * len(y_levels) > 2 * good.sum():
        return False
    cells = np.searchsorted(x_levels, x[good]) * len(y_levels) + np.searchsorted(y_levels, y[good])
    return len(distinct(cells)) > FULL * len(x_levels) * len(y_levels)


def cells_of(across: Levels, up: Levels) -> np.ndarray:
    """Of each case its cell, counted row by row from the lowest; -1 where it has none."""
    there = (across.places >= 0) & (up.places >= 0)
    return np.where(there, up.places * len(across.texts) + across.places, -1)


def standing(values: np.ndarray, cells: np.ndarray, count: int, worse: str) -> np.ndarray:
    """Of each of `count` cells the case that stands for it; -1 where no case of it has a value.

    worse  `<`: a limit is above, and the largest value is the worst; `>`: the smallest is; "": there is no limit, and
           the middle one stands for them
    """
    there = np.flatnonzero((cells >= 0) & ~np.isnan(values))
    order = there[np.lexsort((-values[there] if worse == ">" else values[there], cells[there]))]
    first = np.searchsorted(cells[order], np.arange(count))
    end = np.searchsorted(cells[order], np.arange(count), side="right")
    place = end - 1 if worse else (first + end - 1) // 2
    if not len(order):
        return np.full(count, -1)
    return np.where(end > first, order[np.clip(place, 0, len(order) - 1)], -1)
