"""Exact one-sided bounds on the share of cases that meet a requirement, and on a percentile of a metric.

They hold for cases that are drawn at random, each without regard to the others, and whose number was fixed before
they were looked at. Where cases are looked at while they come in, `met.statistics.sequential` is what holds.

C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404-413, for shares; order statistics for percentiles, as J. M.
Hanson and B. B. Beard use them for launch vehicles (NASA/TP-2010-216447).
"""

from __future__ import annotations

from bisect import bisect_left
from typing import Literal

Verdict = Literal["demonstrated", "not shown", "refuted"]
"""The verdict of some cases on a requirement: it holds, undecided, or it does not hold, each with the confidence."""

MOST_CASES = 10**12
"""Largest number of cases that is considered."""


def can_be_shown(share: float) -> bool:
    """True unless a share lies within a billionth of none or of all cases: no campaign has the cases that show it."""
    return min(share, 1.0 - share) > 0.999e-9  # a billionth but for rounding counts as one


def lower_bound(cases: int, missed: int, confidence: float) -> float:
    """The share of all cases that meet it at least, with this confidence; 0 where no case was run.

    cases  run;  missed: of these;  confidence: above 0 and below 1
    """
    _check(cases, missed, confidence)
    if missed == cases:
        return 0.0
    if not missed:
        return float((1.0 - confidence) ** (1.0 / cases))
    from scipy.special import betaincinv

    return float(betaincinv(cases - missed, missed + 1, 1.0 - confidence))


def upper_bound(cases: int, missed: int, confidence: float) -> float:
    """The largest share of all cases that meet the requirement, with this confidence; 1 where no case missed it."""
    _check(cases, missed, confidence)
    if not missed:
        return 1.0
    if missed == cases:
        return float(1.0 - (1.0 - confidence) ** (1.0 / cases))
    from scipy.special import betaincinv

    return float(betaincinv(cases - missed + 1, missed, confidence))


def verdict(cases: int, missed: int, share: float, confidence: float) -> Verdict:
    """The verdict of these cases on a requirement that at least this share of all cases is to meet."""
    if lower_bound(cases, missed, confidence) >= share:
        return "demonstrated"
    return "refuted" if upper_bound(cases, missed, confidence) < share else "not shown"


def cases_needed(share: float, confidence: float, missed: int = 0) -> int:
    """The fewest cases that demonstrate the share if `missed` of them miss the requirement. Raises ValueError where
    more than `MOST_CASES` were needed."""
    if not 0.0 < share < 1.0:
        raise ValueError(f"a share of {share} cannot be demonstrated by any number of cases")
    high = max(1, 2 * missed)
    while lower_bound(high, missed, confidence) < share:
        high *= 2
        if high > MOST_CASES:
            raise ValueError(f"more than {MOST_CASES} cases")
    numbers = range(missed + 1, high + 1)
    return numbers[bisect_left(numbers, True, key=lambda cases: lower_bound(cases, missed, confidence) >= share)]


def most_misses(cases: int, share: float, confidence: float) -> int:
    """The most cases that may miss the requirement with the share still demonstrated; -1 where even no miss is too
    many."""
    numbers = range(cases + 1)
    return bisect_left(numbers, True, key=lambda missed: lower_bound(cases, missed, confidence) < share) - 1


def percentile_rank(cases: int, share: float, confidence: float) -> int:
    """The rank, from 1 for the smallest value, of the value that bounds a percentile from above with this confidence.

    share  of the percentile: the value below which this share of all cases lies. 0 where there are too few cases for
           any of their values to bound it.
    """
    allowed = most_misses(cases, share, confidence)
    return cases - allowed if allowed >= 0 else 0


def _check(cases: int, missed: int, confidence: float) -> None:
    if not 0 <= missed <= cases:
        raise ValueError(f"{missed} of {cases} cases cannot have missed it")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"a confidence of {confidence} is not above 0 and below 1")
