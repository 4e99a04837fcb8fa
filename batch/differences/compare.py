"""Two histories of one signal, or two columns of one metric: identical, equivalent or different, where and by how much.

Not-a-number at the same place on both sides is the same; on one side alone it differs by more than any tolerance, as an
infinite value does.
"""

from __future__ import annotations

import numpy as np

from batch.differences.tolerance import SignalTolerance
from met.frozen import frozen

IDENTICAL, EQUIVALENT, DIFFERENT, INCOMPARABLE = "identical", "equivalent", "different", "incomparable"
VERDICTS = (IDENTICAL, EQUIVALENT, DIFFERENT, INCOMPARABLE)
"""The verdicts from best to worst. equivalent: bits differ, and no value by more than its tolerance."""


@frozen
class Difference:
    """The difference of two arrays [row, column].

    beyond      how many values differ by more than is allowed;  nan: how many are not-a-number on one side alone
    largest     the largest |b - a|, of those that are beyond where any is, not-a-number apart
    row, column where they differ most, from `before` to `after`: not-a-number on one side, else where it is largest
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
    def most(self) -> float:
        """The size of the difference; not-a-number on one side only counts as infinite."""
        return float("inf") if self.nan else self.largest


def compare(
    a: np.ndarray,
    b: np.ndarray,
    allowed: SignalTolerance,
    time: np.ndarray | None = None,
    absolute: np.ndarray | None = None,
) -> Difference | None:
    """The difference; None where all bits are the same. time: s of each row, where `allowed` has a tolerance of time;
    absolute: of each column, where `allowed.absolute` is not the same for all."""
    return compare_cases(
        a[None], b[None], allowed, None if time is None else SampledCourse(time, time, a[None]), absolute
    )[0]


@frozen
class SampledCourse:
    """The course of a between its rows: `values`, [case, row, column], at `times` s, which may be more rows than are
    compared.

    instants s, of the compared rows, as in b
    """

    instants: np.ndarray
    times: np.ndarray
    values: np.ndarray


def unlike_bits(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """True for each case in which a bit of two arrays of float64, [case, row, column], differs."""
    return np.asarray((_flat(a).view(np.int64) != _flat(b).view(np.int64)).any(axis=1))


def magnitude(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The larger of two sizes, to which a relative tolerance applies; 0 where one is infinite."""
    larger = np.maximum(np.abs(a), np.abs(b))
    return np.asarray(np.where(np.isinf(larger), 0.0, larger))


def spans(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest finite value of each case, [case, row, column]; inf and -inf where there is none."""
    values = _flat(values)
    finite = np.isfinite(values)
    low, high = (values, values) if finite.all() else (np.where(finite, values, end) for end in (np.inf, -np.inf))
    return low.min(axis=1, initial=np.inf), high.max(axis=1, initial=-np.inf)


def _flat(values: np.ndarray) -> np.ndarray:
    """[case, row, column] as [case, value]."""
    return values.reshape(len(values), values.shape[1] * values.shape[2])


def compare_cases(
    a: np.ndarray,
    b: np.ndarray,
    allowed: SignalTolerance,
    passed: SampledCourse | None = None,
    absolute: np.ndarray | None = None,
) -> list[Difference | None]:
    """Compare several cases at once, [case, row, column], with one result a case, as `compare` does. passed: where
    `allowed` has a tolerance of time"""
    shape = a.shape
    a, b = (_flat(np.ascontiguousarray(array, dtype=np.float64)) for array in (a, b))
    unlike = a.view(np.int64) != b.view(np.int64)
    nans = np.zeros(len(a), np.int64)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        apart = np.abs(b - a)
        finite = np.isfinite(apart)
        if not finite.all():
            lost_a, lost_b = np.isnan(a), np.isnan(b)
            nans = (lost_a ^ lost_b).sum(axis=1)
            unlike &= ~(lost_a & lost_b)
            apart[~unlike] = 0.0
            finite = np.isfinite(apart)
        limit = np.asarray(allowed.absolute) if absolute is None else np.tile(absolute, shape[1])
        if allowed.relative:
            limit = limit + allowed.relative * magnitude(a, b)
        over = apart
        if allowed.time and passed is not None and len(passed.times) > 1:
            outside = _flat(_outside(passed, b.reshape(shape), allowed.time))
            over = np.where(finite, np.fmin(apart, outside), apart)
        beyond = unlike & ~(over <= limit)
        # where all have one limit, the largest share is the share of the largest
        tops = over if limit.ndim else np.fmax.reduce(over, axis=1, initial=0.0, keepdims=True)
        used = np.fmax.reduce(np.where(tops == 0.0, 0.0, tops / limit), axis=1, initial=0.0)
    used[nans > 0] = np.inf
    every = np.arange(len(a))
    counts = beyond.sum(axis=1)
    sizes = np.where(beyond | (counts == 0)[:, None], apart, 0.0) if counts.any() else apart
    firsts, places = unlike.argmax(axis=1), sizes.argmax(axis=1)
    places = np.where(sizes[every, places] == 0.0, firsts, places)
    if nans.any():
        lost = np.isnan(sizes)
        places = np.where(nans > 0, lost.argmax(axis=1), places)
        sizes = np.where(lost, 0.0, sizes)
    with np.errstate(over="ignore"):
        squares = np.square(apart if finite.all() else np.where(finite, apart, 0.0)).sum(axis=1)
    firsts_beyond = np.where(counts > 0, beyond.argmax(axis=1) // shape[2], -1)
    columns = (
        counts,
        nans,
        sizes.max(axis=1),
        places // shape[2],
        places % shape[2],
        a[every, places],
        b[every, places],
        squares,
        finite.sum(axis=1),
        firsts // shape[2],
        firsts_beyond,
        used,
    )
    rows = zip(*(array.tolist() for array in columns), strict=True)
    return [Difference(*row) if some else None for some, row in zip(unlike.any(axis=1).tolist(), rows, strict=True)]


def _outside(passed: SampledCourse, b: np.ndarray, early: float) -> np.ndarray:
    """The distance of each value of b from the range that a passes through within `early` s of its instant; a is taken
    as straight between its rows, and an infinite value is none. [case, row, column]"""
    shape = b.shape
    a = np.where(np.isfinite(passed.values), passed.values, np.nan)
    a, b = (array.transpose(1, 0, 2).reshape(array.shape[1], -1) for array in (a, b))
    early += 1e-9 * early + 4.0 * float(np.spacing(np.abs(passed.times).max()))  # for rounding
    instants = passed.instants
    first = np.searchsorted(passed.times, instants - early, side="left")
    last = np.searchsorted(passed.times, instants + early, side="right")
    low, high = _lowest(a, first, last), -_lowest(-a, first, last)
    for column in range(a.shape[1]):
        for shift in (-early, early):
            shifted = np.interp(instants + shift, passed.times, a[:, column])
            low[:, column] = np.fmin(low[:, column], shifted)
            high[:, column] = np.fmax(high[:, column], shifted)
    outside = np.maximum(np.maximum(low - b, b - high), 0.0)
    return np.asarray(outside.reshape(shape[1], shape[0], shape[2]).transpose(1, 0, 2))


def _lowest(values: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """The lowest value of each stretch of rows, `first` to `last` (exclusive); not-a-number for an empty one. It
    combines two stretches of a power of two, found by doubling: O(n log n)."""
    out = np.full((len(first), values.shape[1]), np.nan)
    wide, steps = last - first, 1
    while True:
        some = np.flatnonzero((wide >= steps) & (wide < 2 * steps))
        out[some] = np.fmin(values[first[some]], values[last[some] - steps])
        if 2 * steps > wide.max(initial=0):
            return out
        values, steps = np.fmin(values[:-steps], values[steps:]), 2 * steps
