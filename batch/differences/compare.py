"""Two histories of one signal, or two columns of one metric: identical, equivalent or different, where and by how much.

Not-a-number at the same place on both sides is the same; on one side alone it differs by more than any tolerance.
"""

from __future__ import annotations

import numpy as np

from batch.differences.tolerance import Tolerance
from met.frozen import frozen

IDENTICAL, EQUIVALENT, DIFFERENT, INCOMPARABLE = "identical", "equivalent", "different", "incomparable"
VERDICTS = (IDENTICAL, EQUIVALENT, DIFFERENT, INCOMPARABLE)
"""From best to worst. equivalent: bits differ, and no value by more than its tolerance."""


@frozen
class Difference:
    """Where two arrays [row, column] differ.

    beyond      how many values differ by more than is allowed;  nan: how many are not-a-number on one side alone
    largest     the largest |b - a| of finite values, at row `row`, in column `column`, from `before` to `after`
    squares     sum of the squares of finite differences;  values: how many there are
    first       the first row in which a bit differs;  first_beyond: by more than is allowed, -1 where none
    used        the largest share of what is allowed: 1 where all of it is needed, infinite where nothing is allowed
    """

    beyond: int
    nan: int
    largest: float
    row: int
    column: int
    before: float
    after: float
    squares: float
    values: int
    first: int
    first_beyond: int
    used: float

    @property
    def verdict(self) -> str:
        return DIFFERENT if self.beyond else EQUIVALENT


def compare(a: np.ndarray, b: np.ndarray, allowed: Tolerance, time: np.ndarray | None = None) -> Difference | None:
    """None where all bits are the same. time: s of each row, where `allowed` has a tolerance of time."""
    a, b = (np.ascontiguousarray(array, dtype=np.float64) for array in (a, b))
    lost_a, lost_b = np.isnan(a), np.isnan(b)
    same = (a.view(np.int64) == b.view(np.int64)) | (lost_a & lost_b)
    if same.all():
        return None
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        apart = np.abs(b - a)
        apart[same] = 0.0
        limit = allowed.absolute + allowed.relative * np.maximum(np.abs(a), np.abs(b))
        over = apart
        if allowed.time and time is not None and len(a) > 1:
            over = np.minimum(apart, _outside(a, b, time, allowed.time))
        nan = lost_a ^ lost_b
        beyond = ~same & (nan | ~(over <= limit))
        shares = np.where(over == 0.0, 0.0, over / limit)
    finite = np.where(np.isfinite(apart), apart, 0.0)
    place = int(np.argmax(finite)) if finite.any() else int(np.argmax(~same))
    row, column = divmod(place, a.shape[1])
    first, first_beyond = (int(np.argmax(mask.any(axis=1))) if mask.any() else -1 for mask in (~same, beyond))
    return Difference(
        int(beyond.sum()), int(nan.sum()), float(finite.flat[place]), row, column, float(a.flat[place]),
        float(b.flat[place]), float(np.square(finite).sum()), int(np.isfinite(apart).sum()), first, first_beyond,
        float(np.nanmax(shares, initial=0.0)) if not nan.any() else float("inf"),
    )  # fmt: skip


def _outside(a: np.ndarray, b: np.ndarray, time: np.ndarray, early: float) -> np.ndarray:
    """How far each value of b lies outside of what a passes through within `early` s of its instant; a is taken as
    straight between its rows."""
    low, high = a.copy(), a.copy()
    for column in range(a.shape[1]):
        for shift in (-early, early):
            there = np.interp(time + shift, time, a[:, column])
            low[:, column] = np.fmin(low[:, column], there)
            high[:, column] = np.fmax(high[:, column], there)
    first = np.searchsorted(time, time - early, side="left")
    last = np.searchsorted(time, time + early, side="right")
    for steps in range(1, int((last - first).max(initial=1))):  # the rows within, for tolerances of several steps
        for ahead in (steps, -steps):
            rows = np.arange(len(a)) + ahead
            inside = (rows >= first) & (rows < last)
            low[inside] = np.fmin(low[inside], a[rows[inside]])
            high[inside] = np.fmax(high[inside], a[rows[inside]])
    return np.asarray(np.maximum(np.maximum(low - b, b - high), 0.0))
