"""Grids of two numbers that vary between cases: the spacing of values, levels, whether cases fill the grid, and the
case shown in a cell. Pictures and reports share this module."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np

from batch.queries.signals import number_text
from met.distinct import distinct
from met.frozen import frozen

MOST_LEVELS = 48
"""Largest number of rows and columns of a map; more values share them, in stretches."""

FULL = 0.5
"""Smallest share of its cells in which a grid has cases, or designs: two parameters in step make no grid."""


Scale = Literal["linear", "log", "place"]

EVEN, EVEN_LOG = 0.05, 0.15
"""Largest relative difference of steps that count as even: 0.33, 0.67, 1 do; and of steps of logarithms: 1, 3, 10 do,
1, 2, 5, 10 do not."""

SPAN, METRIC_SPAN = 100.0, 1000.0
"""Ratio of the largest to the smallest value from which on an axis of points is logarithmic: of a parameter, of a
metric."""


ROUND = ((1, 2, 5), (1, 3), (1,))
"""Steps within a power of ten of a logarithmic axis, the densest first."""


@frozen
class Levels:
    """One side of a grid of cases: its levels, and the level of each case.

    values  the different values, rising; of too many the edges of stretches of them, one more than `texts`
    texts   each level in words
    places  of each case which level it has; -1 where its value is no number
    scale   how the levels are spaced; `place`: neither evenly nor by factors, so that all are as wide
    """

    values: np.ndarray
    texts: tuple[str, ...]
    places: np.ndarray
    scale: Scale

    @property
    def stretches(self) -> bool:
        """True if a level is a stretch of values."""
        return len(self.values) > len(self.texts)


def levels(values: np.ndarray) -> np.ndarray:
    """The distinct values that are numbers, ascending."""
    return distinct(values[np.isfinite(values)])


def spacing(numbers: np.ndarray) -> Scale:
    """The spacing of distinct ascending values: by equal steps, by equal factors, or neither."""
    if len(numbers) < 2:
        return "place"
    if _even(numbers, EVEN):
        return "linear"
    return "log" if numbers[0] > 0.0 and _even(np.log(numbers), EVEN_LOG) else "place"


def is_log(numbers: np.ndarray) -> bool:
    """True if points at these distinct ascending values lie on a logarithmic axis: they rise by factors, or span so
    many that the small ones would coincide."""
    if len(numbers) < 3 or numbers[0] <= 0.0:
        return False
    scale = spacing(numbers)
    return scale == "log" or (scale == "place" and spans(numbers, SPAN))


def spans(values: np.ndarray, ratio: float) -> bool:
    """True if values are all positive and the largest is at least `ratio` times the smallest."""
    finite = values[np.isfinite(values)]
    low, high = finite.min(initial=np.inf), finite.max(initial=-np.inf)
    return bool(0.0 < low < np.inf and high / ratio >= low)


def column_levels(values: np.ndarray, words: Sequence[str] = (), most: int = MOST_LEVELS) -> Levels:
    """The levels of a column.

    words  of a choice, what its numbers stand for
    most   so many levels of values that come again and again, as in a grid; samples share MOST_LEVELS at most
    """
    distinct_values = levels(values)
    finite = np.isfinite(values)
    scale: Scale = "place" if words else spacing(distinct_values)
    again = scale != "place" or 2 * len(distinct_values) <= int(finite.sum())
    if not again:
        most = min(most, MOST_LEVELS)
    places = np.full(len(values), -1)
    if len(distinct_values) <= most:
        places[finite] = np.searchsorted(distinct_values, values[finite])
        texts = [words[int(v)] if words else number_text(float(v)) for v in distinct_values]
        return Levels(distinct_values, tuple(texts), places, scale)
    if again:
        return _neighbours(distinct_values, values, most, scale)
    scale = "log" if is_log(distinct_values) else "linear"
    edges = (np.geomspace if scale == "log" else np.linspace)(distinct_values[0], distinct_values[-1], most + 1)
    places[finite] = np.clip(np.searchsorted(edges, values[finite], side="right") - 1, 0, most - 1)
    texts = [f"{number_text(float(a))} … {number_text(float(b))}" for a, b in pairwise(edges)]
    return Levels(edges, tuple(texts), places, scale)


def _neighbours(distinct_values: np.ndarray, values: np.ndarray, most: int, scale: Scale) -> Levels:
    """Stretches of neighbouring values, with equal numbers in each, so that none is empty; they meet half way between
    values."""
    stretch = np.arange(len(distinct_values)) * most // len(distinct_values)
    first = np.searchsorted(stretch, np.arange(most))
    last = np.append(first[1:], len(distinct_values)) - 1
    edges = edges_of(distinct_values, scale)[np.append(first, len(distinct_values))]
    texts = [
        number_text(float(a)) if a == b else f"{number_text(float(a))} … {number_text(float(b))}"
        for a, b in zip(distinct_values[first], distinct_values[last], strict=True)
    ]
    finite = np.isfinite(values)
    places = np.full(len(values), -1)
    places[finite] = stretch[np.searchsorted(distinct_values, values[finite])]
    return Levels(edges, tuple(texts), places, scale)


def edges_of(distinct_values: np.ndarray, scale: Scale) -> np.ndarray:
    """Edges half way between values, and as far beyond the first and the last; by factors on a logarithmic scale."""
    if scale == "log":
        return np.asarray(np.exp(edges_of(np.log(distinct_values), "linear")))
    middles = (distinct_values[1:] + distinct_values[:-1]) / 2
    return np.concatenate(
        [
            [1.5 * distinct_values[0] - 0.5 * distinct_values[1]],
            middles,
            [1.5 * distinct_values[-1] - 0.5 * distinct_values[-2]],
        ]
    )


def round_numbers(low: float, high: float, steps: Sequence[int]) -> list[float]:
    """The numbers from low to high that are one of these, times a power of ten."""
    powers = range(math.floor(math.log10(low)), math.floor(math.log10(high)) + 1)
    candidates = (float(f"{step}e{power}") for power in powers for step in steps)
    return [x for x in candidates if low <= x <= high]


def _even(values: np.ndarray, share: float) -> bool:
    steps = np.diff(values)
    return bool(np.ptp(steps) <= share * steps.mean())


def is_grid(x: np.ndarray, y: np.ndarray) -> bool:
    """True if most of the combinations of two parameters' values occur among the cases."""
    good = np.isfinite(x) & np.isfinite(y)
    x_levels, y_levels = levels(x), levels(y)
    if len(x_levels) < 2 or len(y_levels) < 2 or len(x_levels) * len(y_levels) > 2 * good.sum():
        return False
    cells = np.searchsorted(x_levels, x[good]) * len(y_levels) + np.searchsorted(y_levels, y[good])
    return len(distinct(cells)) > FULL * len(x_levels) * len(y_levels)


def cells_of(across: Levels, up: Levels) -> np.ndarray:
    """The cell of each case, counted row by row from the lowest; -1 where it has none."""
    inside = (across.places >= 0) & (up.places >= 0)
    return np.where(inside, up.places * len(across.texts) + across.places, -1)


def cell_cases(values: np.ndarray, cells: np.ndarray, count: int, worse: str) -> np.ndarray:
    """The case that is shown in each of `count` cells; -1 where no case of it has a value.

    worse  `<`: a limit is above, and the largest value is the worst; `>`: the smallest is; "": there is no limit, and
           the middle one stands for them
    """
    with_value = np.flatnonzero((cells >= 0) & ~np.isnan(values))
    order = with_value[np.lexsort((-values[with_value] if worse == ">" else values[with_value], cells[with_value]))]
    first = np.searchsorted(cells[order], np.arange(count))
    end = np.searchsorted(cells[order], np.arange(count), side="right")
    place = end - 1 if worse else (first + end - 1) // 2
    if not len(order):
        return np.full(count, -1)
    return np.where(end > first, order[np.clip(place, 0, len(order) - 1)], -1)
