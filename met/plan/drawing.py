"""Values drawn from distributions: the quantiles of points of (0, 1), rounded to 12 digits in the deck's unit.

So a table that is printed and read back is the same table, and last digits in which versions of a library differ do not
change a case. Independent draws come from a counter-based generator, Philox 4x64-10 as numpy has it: value k of a
parameter follows from the seed, the parameter's path and k, so any of them is computed without those before it.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cached_property

import numpy as np

from met import units
from met.plan.columns import BLOCK, ComputedColumn, blocks
from met.unit_parser import parse_unit

DIGITS = 12

CHUNK = 1 << 12
"""Points of a stream that are drawn together where the wanted ones are not consecutive."""

KEPT_BLOCKS = 16
"""Number of blocks of a column that are kept, half a megabyte each: enough for the cases of the longest tasks that are
merged together."""

A_COUNT = 4
"""Number of random numbers that the generator gives at each count."""

TENS = np.cumprod(np.concatenate([[1], np.full(27, 10)]).astype(np.longdouble))
"""Powers of ten that are exact with 64 bits: 10^27 has 63 bits without its factors of two."""

SURE = np.longdouble(2.0) ** -61
"""Relative error bound of the extended arithmetic below."""


def points(seed: int, path: str, number: int, first: int, last: int) -> np.ndarray:
    """Points `first` to `last` (exclusive) of a parameter's stream, independent and uniform in the open unit interval.

    number  of the sample in its sweep, from 1: each has streams of its own
    """
    source = np.random.Philox(key=[seed, zlib.crc32(path.encode()) << 32 | number])
    source.advance(first // A_COUNT)
    before = first % A_COUNT
    drawn = np.random.Generator(source).random(before + last - first)[before:]
    return within(drawn)


def within(drawn: np.ndarray) -> np.ndarray:
    """Points of the closed unit interval moved off its ends."""
    return np.asarray(np.clip(drawn, 2.0**-54, 1.0 - 2.0**-53))


def drawn_values(
    distribution: str, arguments: tuple[float, ...], measure: units.Measure | None, levels: np.ndarray
) -> np.ndarray:
    """Quantiles at these points of (0, 1), SI, rounded in a unit; None: the number 1. arguments: SI."""
    scale = measure.scale if measure is not None else 1.0
    exact = QUANTILES[distribution](levels, *(x / scale for x in arguments))
    values = rounded(exact, measure if measure is not None else units.ONE)
    if distribution == "normal":
        return values
    low, high = arguments[-2:]
    return np.clip(values, low, high)


def is_sound(distribution: str, arguments: tuple[float, ...]) -> bool:
    """True if a distribution can have these arguments: a deviation above 0, ends that rise, logarithms that exist."""
    if distribution in ("normal", "truncated") and arguments[1] <= 0.0:
        return False
    if distribution == "normal":
        return True
    low, high = arguments[-2:]
    return low < high and (distribution != "loguniform" or low > 0.0)


class DrawnColumn(ComputedColumn):
    """Independent draws of one parameter. unit: in which they are rounded, as text; "": none. Other fields as for
    `points` and `drawn_values`."""

    def __init__(
        self, count: int, seed: int, path: str, number: int, distribution: str, arguments: tuple[float, ...], unit: str
    ) -> None:
        super().__init__(count)
        self.seed, self.path, self.number = seed, path, number
        self.distribution, self.arguments, self.unit = distribution, arguments, unit
        self._measure = parse_unit(unit) if unit else None
        self._drawn: dict[int, np.ndarray] = {}

    def at(self, rows: np.ndarray) -> np.ndarray:
        """The drawn values of these rows, [row], computed in chunks of points."""
        if not len(rows):
            return np.empty(0)
        if len(rows) > 1 and not (np.diff(rows) >= 0).all():
            wanted, back = np.unique(rows, return_inverse=True)
            return np.asarray(self.at(wanted)[back.ravel()])
        if rows[-1] - rows[0] < len(rows) + CHUNK:
            return np.asarray(self._between(int(rows[0]), int(rows[-1]) + 1)[rows - rows[0]])
        edges = np.flatnonzero(np.diff(rows // CHUNK)) + 1
        parts = np.split(rows, edges)
        return np.concatenate([self._between(int(part[0]), int(part[-1]) + 1)[part - part[0]] for part in parts])

    @cached_property
    def ends(self) -> tuple[int, int]:
        """A row with the least value, and one with the largest, as values rise with the points. Among equal values it
        is the first, unless there are too many to compare."""
        low, high = _Nearest(), _Nearest()
        for rows in blocks(self.size):
            levels = points(self.seed, self.path, self.number, rows.start, rows.stop)
            low.add(levels, rows.start)
            high.add(-levels, rows.start)
        values = [self.at(np.sort(extreme.rows)) for extreme in (low, high)]
        first, last = int(np.argmin(values[0])), int(np.argmax(values[1]))
        return int(np.sort(low.rows)[first]), int(np.sort(high.rows)[last])

    def _between(self, first: int, last: int) -> np.ndarray:
        """Draws `first` to `last` (exclusive). The last few blocks are kept, since names of cases, inputs and
        comparisons ask for the same draws again."""
        if last - first < CHUNK:
            return self._draw(first, last)
        parts = []
        for number in range(first // BLOCK, (last - 1) // BLOCK + 1):
            block = self._drawn.get(number)
            if block is None:
                block = self._draw(number * BLOCK, min((number + 1) * BLOCK, self.size))
                self._drawn[number] = block  # threads that draw it at once all draw the same
                for old in list(self._drawn)[:-KEPT_BLOCKS]:
                    self._drawn.pop(old, None)
            parts.append(block[max(0, first - number * BLOCK) : last - number * BLOCK])
        return np.concatenate(parts)

    def _draw(self, first: int, last: int) -> np.ndarray:
        levels = points(self.seed, self.path, self.number, first, last)
        return drawn_values(self.distribution, self.arguments, self._measure, levels)


class _Nearest:
    """Rows of the smallest points so far: more than can be rounded to one value."""

    MOST = 64

    def __init__(self) -> None:
        self._levels, self.rows = np.zeros(0), np.zeros(0, np.int64)

    def add(self, levels: np.ndarray, first: int) -> None:
        """Take the next levels in (0, 1), of rows from `first` on, and keep the rows of the least."""
        some = np.flatnonzero(levels < self._levels[-1]) if len(self._levels) == self.MOST else np.arange(len(levels))
        if len(some):
            both = np.concatenate([self._levels, levels[some]])
            order = np.argsort(both, kind="stable")[: self.MOST]
            self._levels, self.rows = both[order], np.concatenate([self.rows, first + some])[order]


# Rounding


def rounded(exact: np.ndarray, measure: units.Measure) -> np.ndarray:
    """Numbers of a unit rounded to 12 digits, then in SI rounded once more: `measure.to_si(float(f"{x:.12g}"))`.

    All numbers are rounded at once in 64-bit arithmetic; those where it cannot tell which of two doubles is nearest are
    done one by one: 1 % of them, or all on a machine with only 53 bits.
    """
    numbers, extended, scale = np.empty(len(exact)), np.finfo(np.longdouble).nmant >= 63, _scale(measure)
    for first in range(0, len(exact), CHUNK):  # chunks that fit into the processor's cache take a tenth of the time
        some, left = exact[first : first + CHUNK], list(range(min(CHUNK, len(exact) - first)))
        if extended:
            converted, sure = _in_extended(some, scale)
            numbers[first : first + CHUNK], left = converted, np.flatnonzero(~sure).tolist()
        for n in left:
            numbers[first + n] = measure.to_si(float(f"{some[n]:.{DIGITS}g}"))
    return numbers


def _in_extended(exact: np.ndarray, scale: np.longdouble) -> tuple[np.ndarray, np.ndarray]:
    """The numbers rounded in extended arithmetic, and a truth for each that is certain. scale: SI units in one of the
    unit."""
    with np.errstate(all="ignore"):
        size = np.abs(exact)
        shift = (DIGITS - 1) - np.floor(np.log10(size))
        sure = np.abs(shift) < len(TENS)
        steps = np.where(sure, shift, 0.0).astype(np.int64)
        tens, up = TENS[np.abs(steps)], steps >= 0
        scaled = np.where(up, size * tens, size / tens)
        digits = np.rint(scaled)
        sure &= (scaled >= 10.0 ** (DIGITS - 1)) & (scaled < 10.0**DIGITS - 1.0)
        sure &= np.abs(np.abs(scaled - digits) - 0.5) > 2.0**-20
        value = np.where(up, digits / tens, digits * tens) * scale
        nearest = value.astype(np.float64)
        off = np.abs(value - nearest)
        sure &= 0.5 * np.spacing(nearest) - off > SURE * value
        sure &= (np.frexp(nearest)[0] != 0.5) & (nearest > 2.0**-1000) & (nearest < 2.0**1000)
    return np.copysign(nearest, exact), sure


def _scale(measure: units.Measure) -> np.longdouble:
    """SI units in one of a unit, in extended precision."""
    whole = measure.exact
    high = float(whole)
    return np.longdouble(high) + np.longdouble(float(whole - Fraction(high)))


def _truncated(levels: np.ndarray, mean: float, deviation: float, low: float, high: float) -> np.ndarray:
    """Quantiles of a normal distribution between two ends, at levels in (0, 1)."""
    from scipy.stats import truncnorm

    quantiles = truncnorm.ppf(levels, (low - mean) / deviation, (high - mean) / deviation, loc=mean, scale=deviation)
    return np.asarray(quantiles, dtype=float)


def _normal(levels: np.ndarray, mean: float, deviation: float) -> np.ndarray:
    from scipy.special import ndtri

    return np.asarray(mean + deviation * ndtri(levels), dtype=float)


def _loguniform(levels: np.ndarray, low: float, high: float) -> np.ndarray:
    """Quantiles by equal ratios, with both ends on one side of 0; by their logarithms where no double holds their
    ratio."""
    with np.errstate(over="ignore", under="ignore"):
        ratio = np.float64(high) / low
    if np.finfo(float).tiny <= ratio < np.inf:
        return np.asarray(low * np.exp(np.log(ratio) * levels))
    first, last = np.log(np.abs([low, high]))
    return np.asarray(np.sign(low) * np.exp(first + (last - first) * levels))


ARGUMENTS: Mapping[str, int] = {"uniform": 2, "loguniform": 2, "normal": 2, "truncated": 4}
"""Number of arguments of each distribution."""

QUANTILES: Mapping[str, Callable[..., np.ndarray]] = {
    "uniform": lambda levels, low, high: low + (high - low) * levels,
    "loguniform": _loguniform,
    "normal": _normal,
    "truncated": _truncated,
}
