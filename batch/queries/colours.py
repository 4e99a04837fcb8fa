"""The range of a metric's colours, chosen so that a few outliers do not leave one colour to all others.

Pictures and reports take it from here, and say how many values lie beyond either end.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batch.queries.signals import number_text
from met.frozen import frozen

TENTH = 0.1
"""Values can be distinguished by colours if more than this share lies outside of the densest tenth of their range."""

TOLD = 0.25
"""The share that must be distinguishable when values are left out for that."""

MOST_OUT = 0.45
"""Largest share of the values that is left out."""

APART = ((0.1, 10.0), (1.0, 100.0))
SINGLE_APART = 30.0
"""Width of the gap, relative to the range of all other values, beyond which values are left out: by their share of all
values, and for a single one."""

NOISE = 1e-6
"""Relative differences below this one do not make a range of colours."""

LIMIT_APART = 20.0
"""A limit nearer than this, relative to the range of the colours, is included in it."""

DECADES = 1000.0
"""Ratio of the largest to the smallest value from which on colours may be logarithmic."""

LOOKED_AT = 4096
"""Largest number of values from which the range is computed; of more, a sample within the share `NEAR` is used."""

NEAR = 0.02


@frozen
class Reach:
    """The range of the colours. below, above: the number of values beyond, and the furthest of them"""

    low: float
    high: float
    log: bool = False
    below: int = 0
    above: int = 0
    least: float = np.nan
    most: float = np.nan

    @property
    def beyond_texts(self) -> tuple[str, str]:
        """The values below and above, in words; "" where there are none."""
        return (
            f"{self.below:,} below, down to {number_text(self.least)}" if self.below else "",
            f"{self.above:,} above, up to {number_text(self.most)}" if self.above else "",
        )


def reach(
    values: np.ndarray, limits: Sequence[float] = (), *, parting: bool = False, by_factors: bool = False
) -> Reach | None:
    """The range of the colours of some values; None where no value is finite.

    limits      within the colours where they are near
    parting     of changes: as far below zero as above it
    by_factors  of a parameter whose values rise by factors: colours are logarithmic, from the least to the greatest

    All values are within, unless they are hardly told apart then: nine in ten of them in a tenth of the range, or some
    of them beyond a gap many times wider than the range of all others. Then the fewest are left out by which the others
    are told apart. Where none are found and all are above zero, colours are logarithmic.
    """
    finite = np.sort(values[np.isfinite(values)])
    if not len(finite):
        return None
    if by_factors and finite[0] > 0.0:
        return Reach(float(finite[0]), float(finite[-1]), True, least=float(finite[0]), most=float(finite[-1]))
    with np.errstate(over="ignore"):
        low, high, log = _reach(finite, limits, parting=parting)
    below, above = int((finite < low).sum()), int((finite > high).sum())
    return Reach(low, high, log, below, above, float(finite[0]), float(finite[-1]))


def _reach(finite: np.ndarray, limits: Sequence[float], *, parting: bool) -> tuple[float, float, bool]:
    """The ends of a range of colours, and whether it is by logarithms. finite: ascending; parting: about 0, as of
    changes"""
    if parting:
        far = np.sort(np.abs(finite))
        _, top, _ = _inner(_thinned(far))
        top = float(far[np.searchsorted(far, (1.0 + NEAR) * top, side="right") - 1]) if len(far) > LOOKED_AT else top
        return -(top or 1.0), top or 1.0, False
    low, high, log = _inner(_thinned(finite))
    if not log and len(finite) > LOOKED_AT:
        near = NEAR * (high - low)
        low = float(finite[np.searchsorted(finite, low - near)])
        high = float(finite[np.searchsorted(finite, high + near, side="right") - 1])
    for limit in limits:
        near = LIMIT_APART * (high - low)
        if finite[0] <= limit <= finite[-1] and low - near < limit < high + near:
            low, high = min(low, limit), max(high, limit)
    return low, high, log


def _thinned(finite: np.ndarray) -> np.ndarray:
    """A sample of many sorted values, including the extremes."""
    if len(finite) <= LOOKED_AT:
        return finite
    return np.asarray(finite[np.linspace(0, len(finite) - 1, LOOKED_AT).round().astype(int)])


def _inner(finite: np.ndarray) -> tuple[float, float, bool]:
    """The range of sorted values in which they are distinguishable, and whether by their logarithms."""
    part = _without_far(finite)
    if _spread_share(part) < TENTH:
        shortest = _shortest(part)
        if shortest is not None:
            part = shortest
        elif part[0] > 0.0 and part[-1] >= DECADES * part[0] and _spread_share(np.log(part)) >= TOLD:
            return float(part[0]), float(part[-1]), True
    return float(part[0]), float(part[-1]), False


def _without_far(part: np.ndarray) -> np.ndarray:
    """The values without those beyond a gap that dwarfs the range of all others."""
    count = len(part)
    while len(part) > 2:
        gaps = np.diff(part)
        gap = int(gaps.argmax()) + 1
        few, rest = sorted((part[:gap], part[gap:]), key=len)
        out = (count - len(rest)) / count
        factor = next(factor_of_share for share, factor_of_share in APART if out <= share)
        if len(few) == 1:
            factor = min(factor, SINGLE_APART)
        if len(few) == len(rest) or out > MOST_OUT or not _shows(rest) or gaps[gap - 1] < factor * np.ptp(rest):
            break
        part = rest
    return part


def _shortest(part: np.ndarray) -> np.ndarray | None:
    """The shortest range that holds all but the fewest values, in which the values are distinguishable."""
    for out in np.unique(np.geomspace(1, max(1.0, MOST_OUT * len(part)), 40).astype(int)):
        kept_count = len(part) - int(out)
        if kept_count < 2:
            break
        first = int((part[kept_count - 1 :] - part[: len(part) - kept_count + 1]).argmin())
        dense = part[first : first + kept_count]
        if _shows(dense) and _spread_share(dense) >= TOLD:
            beside = np.ptp(dense) / 2  # a range as near as that distinguishes the others as well
            return part[(part >= dense[0] - beside) & (part <= dense[-1] + beside)]
    return None


def _spread_share(part: np.ndarray) -> float:
    """The share of sorted values outside of the densest tenth of their range."""
    ends = np.searchsorted(part, part + TENTH * np.ptp(part), side="right")
    return 1.0 - float((ends - np.arange(len(part))).max()) / len(part)


def _shows(part: np.ndarray) -> bool:
    """True if the values differ by more than roundings."""
    return bool(np.ptp(part) > NOISE * np.abs(part).max())
