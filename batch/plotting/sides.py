"""The side of a map: the positions of a parameter's values, and the numbers that are written there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from batch.plotting.layout import LETTER, PictureSheet, with_unit
from batch.queries import grids
from batch.queries.grids import ROUND, Levels, Scale, column_levels, edges_of, levels, round_numbers
from batch.queries.pool import CaseColumn
from batch.queries.signals import number_text
from met.frozen import frozen

MOST_CELLS = 300
"""Largest number of columns and rows of cells in a picture: with more, a cell would be no wider than a dot."""

SHORT = 5
"""Largest number of letters of a value that is written exactly, not replaced by round numbers."""

APART = 0.1
"""Smallest distance between numbers on an axis, inches."""

BEYOND = 0.05
"""Room beyond the first and the last point, relative to the span of all."""


@frozen
class MapSide:
    """edges: of the cells, one more than there are, or of points the two ends of the axis;  scale: `place` where all
    cells have one width."""

    column: CaseColumn
    levels: Levels
    edges: np.ndarray
    scale: Scale

    @property
    def label(self) -> str:
        """The label of the axis, with its unit."""
        return with_unit(self.column.label, self.column.unit)

    @property
    def centres(self) -> np.ndarray:
        """The centres of the cells on the axis."""
        if self.scale == "log":
            return np.asarray(np.sqrt(self.edges[1:] * self.edges[:-1]))
        return np.asarray((self.edges[1:] + self.edges[:-1]) / 2)

    @property
    def level_positions(self) -> np.ndarray:
        """The positions of the levels on the axis."""
        return self.centres if self.scale == "place" else self.levels.values

    def of_cases(self) -> np.ndarray:
        """The positions of the cases on the axis."""
        return self.levels.places.astype(float) if self.scale == "place" else self.column.values


def side(column: CaseColumn) -> MapSide:
    """The side of a map of cells."""
    own_levels = column_levels(column.values, column.words, MOST_CELLS)
    if own_levels.scale == "place":
        edges = np.arange(len(own_levels.texts) + 1) - 0.5
    else:
        edges = own_levels.values if own_levels.stretches else edges_of(own_levels.values, own_levels.scale)
    return MapSide(column, own_levels, edges, own_levels.scale)


def line(column: CaseColumn) -> MapSide:
    """The side of points, which lie at their values; words at their places."""
    own_levels = column_levels(column.values, column.words)
    if column.words:
        return side(column)
    values = levels(column.values)
    if not len(values):
        return MapSide(column, own_levels, np.array([0.0, 1.0]), "linear")
    log = is_log(column)
    ends = np.log(values[[0, -1]]) if log else values[[0, -1]]
    ends = ends + BEYOND * (float(ends[1] - ends[0]) or abs(float(ends[0])) or 1.0) * np.array([-1.0, 1.0])
    return MapSide(column, own_levels, np.exp(ends) if log else ends, "log" if log else "linear")


def is_log(column: CaseColumn) -> bool:
    """True if a parameter has a logarithmic axis (`grids.is_log`)."""
    return column.role == "parameter" and grids.is_log(levels(column.values))


def write(
    axis: Any, map_side: MapSide, inches: float, sheet: PictureSheet, *, upright: bool, cells: bool = True
) -> None:
    """Write the values that fit on an axis of this length; if there are many, or for points, round numbers between
    them."""
    from matplotlib.ticker import NullLocator

    axis.set_minor_locator(NullLocator())
    texts = [text.partition(" … ")[0] for text in map_side.levels.texts]
    room = max(2, int(inches / (1.9 * sheet.normal / 72 if upright else _wide(texts, sheet) + APART)))
    every = -(-len(texts) // room)
    whole = cells and every == 1 and max(map(len, texts)) <= SHORT and not map_side.levels.stretches
    if map_side.scale == "log" and not whole:
        write_log(axis, map_side, inches, sheet, upright=upright)
    elif map_side.scale == "place" or whole:
        axis.set_ticks(map_side.level_positions[::every], texts[::every])


def write_log(axis: Any, map_side: MapSide, inches: float, sheet: PictureSheet, *, upright: bool = False) -> None:
    """Write on a logarithmic axis of this length the values, if they are few and short, else as many round numbers as
    fit."""
    from matplotlib.ticker import NullLocator

    axis.set_minor_locator(NullLocator())
    low, high = float(map_side.edges[0]), float(map_side.edges[-1])
    tries = [round_numbers(low, high, steps) for steps in ROUND]
    if max(map(len, map_side.levels.texts)) <= SHORT and not map_side.levels.stretches:
        tries.insert(0, map_side.levels.values.tolist())
    values = next(
        (numbers for numbers in tries if _apart(numbers, low, high, inches, sheet, upright=upright)), tries[-1]
    )
    while not _apart(values, low, high, inches, sheet, upright=upright):
        values = values[::2]
    if len(values) < 2:  # less than a factor of 2.5: the axis is nearly linear
        values = [x for x in _even_numbers(low, high, inches, sheet) if low <= x <= high]
    axis.set_ticks(values, [number_text(x) for x in values])


def _even_numbers(low: float, high: float, inches: float, sheet: PictureSheet) -> list[float]:
    """Round numbers between two ends, as many as fit on an axis of this length, inches."""
    from matplotlib.ticker import MaxNLocator

    wide = _wide([number_text(low), number_text(high)], sheet) + APART
    return [float(x) for x in MaxNLocator(nbins=max(2, min(5, int(inches / wide)))).tick_values(low, high)]


def _apart(
    values: Sequence[float], low: float, high: float, inches: float, sheet: PictureSheet, *, upright: bool
) -> bool:
    """True if the numbers do not overlap on a logarithmic axis."""
    if len(values) < 2 or not high > low:
        return True
    places = [inches * math.log(x / low) / math.log(high / low) for x in values]
    sizes = [1.5 * sheet.normal / 72 if upright else _wide([number_text(x)], sheet) + APART for x in values]
    between = zip(pairwise(places), pairwise(sizes), strict=True)
    return all(b - a >= (own_width + other) / 2 for (a, b), (own_width, other) in between)


def _wide(texts: Sequence[str], sheet: PictureSheet) -> float:
    """Width of the longest text, inches."""
    return max(map(len, texts)) * LETTER * sheet.normal / 72
