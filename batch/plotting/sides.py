"""The side of a map: where the cells of a parameter's values lie, and which of the values are written there."""

from __future__ import annotations

from typing import Literal

import numpy as np

from batch.grids import Levels, levelled, levels
from batch.plotting.layout import LETTER
from batch.plotting.sheet import Sheet
from batch.pool import Column
from met.frozen import frozen

EVEN, EVEN_LOG = 0.02, 0.15
"""How much steps may differ, against their mean, that values are said to rise evenly; of their logarithms: 1, 2, 5, 10
does not, 1, 3, 10 does."""


SPAN = 100.0
"""Largest value against the smallest, from which on an axis is logarithmic."""

SHORT = 5
"""Letters of values that are written rather than round numbers between them."""


@frozen
class Side:
    """edges: of the cells, one more than there are;  scale: `place` where all cells have one width."""

    column: Column
    levels: Levels
    edges: np.ndarray
    scale: Literal["linear", "log", "place"]

    @property
    def label(self) -> str:
        return f"{self.column.label}  ({self.column.unit})" if self.column.unit else self.column.label

    @property
    def centres(self) -> np.ndarray:
        """Of the cells, on the axis."""
        if self.scale == "log":
            return np.asarray(np.sqrt(self.edges[1:] * self.edges[:-1]))
        return np.asarray((self.edges[1:] + self.edges[:-1]) / 2)

    @property
    def at(self) -> np.ndarray:
        """Where the values stand on the axis."""
        return self.centres if self.scale == "place" else self.levels.values

    def of_cases(self) -> np.ndarray:
        """Where the cases stand on the axis."""
        return self.levels.places.astype(float) if self.scale == "place" else self.column.values


def side(column: Column) -> Side:
    found = levelled(column.values, column.words)
    values = found.values
    if found.stretches:
        return Side(column, found, values, "linear")
    if not column.words and len(values) > 1 and _even(values, EVEN):
        return Side(column, found, _edges(values), "linear")
    if not column.words and len(values) > 2 and values[0] > 0 and _even(np.log(values), EVEN_LOG):
        return Side(column, found, np.exp(_edges(np.log(values))), "log")
    return Side(column, found, np.arange(len(values) + 1) - 0.5, "place")


def is_log(column: Column) -> bool:
    """Whether a parameter's values rise by factors, or span so many that the small ones would be one on another."""
    values = levels(column.values)
    if column.role != "parameter" or len(values) < 3 or values[0] <= 0 or _even(values, EVEN):
        return False
    return _even(np.log(values), EVEN_LOG) or bool(values[-1] >= SPAN * values[0])


def _even(values: np.ndarray, share: float) -> bool:
    steps = np.diff(values)
    return bool(np.ptp(steps) <= share * steps.mean())


def _edges(values: np.ndarray) -> np.ndarray:
    """Half way between values, and as far beyond the first and the last."""
    middles = (values[1:] + values[:-1]) / 2
    return np.concatenate([[1.5 * values[0] - 0.5 * values[1]], middles, [1.5 * values[-1] - 0.5 * values[-2]]])


def write(axis: object, found: Side, inches: float, sheet: Sheet, *, upright: bool) -> None:
    """The values that have room on an axis of this length; of many that rise evenly, round numbers between them."""
    from matplotlib.ticker import NullLocator

    axis.set_minor_locator(NullLocator())  # type: ignore[attr-defined]
    texts = found.levels.texts
    wide = max(map(len, texts)) * LETTER * sheet.normal / 72 + 0.1
    room = max(2, int(inches / (1.9 * sheet.normal / 72 if upright else wide)))
    every = -(-len(texts) // room)
    if found.scale == "linear" and (every > 1 or found.levels.stretches or max(map(len, texts)) > SHORT):
        return
    axis.set_ticks(found.at[::every], texts[::every])  # type: ignore[attr-defined]
