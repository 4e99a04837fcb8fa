"""Thinning of lines that keeps their extremes."""

from __future__ import annotations

import numpy as np


def stretch(rows: int, points: int) -> int:
    """Number of rows for two points; 1 where every row has its point."""
    return 1 if rows <= points else -(-rows // (points // 2))


def thin_clock(time: np.ndarray, points: int) -> np.ndarray:
    """The times of the points: the first row and the middle one of each stretch."""
    length = stretch(len(time), points)
    if length == 1:
        return time
    first = np.arange(0, len(time), length)
    return np.stack([time[first], time[np.minimum(first + length // 2, len(time) - 1)]], axis=1).ravel()


def thin(values: np.ndarray, points: int) -> np.ndarray:
    """The smallest and the largest value of each stretch of rows, in the order in which they come.

    values: (time, line). Values that are not finite are none; a stretch of nothing else is not a number.
    """
    values = np.where(np.isfinite(values), values, np.nan)
    length = stretch(len(values), points)
    if length == 1:
        return values
    count = -(-len(values) // length)
    padded = np.full((count * length, values.shape[1]), np.nan)
    padded[: len(values)] = values
    parts = padded.reshape(count, length, -1)
    none = np.isnan(parts)
    extremes = [np.where(none, other, sign * parts).argmin(axis=1) for sign, other in ((1.0, np.inf), (-1.0, np.inf))]
    pair = np.sort(np.stack(extremes, axis=1), axis=1)
    return np.take_along_axis(parts, pair, axis=1).reshape(2 * count, -1)
