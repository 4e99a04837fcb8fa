"""A test of a share of cases that may be looked at after every case: it stops as soon as the cases decide.

A bound for a fixed number of cases is wrong if one watches cases come in and stops when it is reached: at 90 %
confidence more than one campaign in three would say "demonstrated" of a requirement that is not met. A valid test is a
process that is a nonnegative supermartingale where the requirement is not met, so that it ever exceeds 1 / (1 -
confidence) with a probability of at most 1 - confidence (J. Ville, 1939): an e-process (A. Ramdas, P. Grunwald, V. Vovk
and G. Shafer, Statistical Science 38 (2023) 576-601). Here it is the likelihood of the cases under shares of misses
that meet the requirement, averaged over a beta distribution that is cut off at the share allowed, against their
likelihood at the share allowed; and the same on the other side for "refuted".

One more case that meets the requirement always adds to the evidence for it, and one more that misses it takes from it.
So both verdicts are limits on numbers of cases for each number of misses, `DecisionLimits`, found once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from met.frozen import frozen
from met.statistics.confidence import MOST_CASES, Verdict

WEIGHT = 0.5
"""First parameter of the beta distribution of shares of misses: Jeffreys'; the second has the mean at a quarter of the
share allowed."""


def evidence_for(cases: np.ndarray, missed: np.ndarray, share: float) -> np.ndarray:
    """The logarithm of the evidence (a likelihood ratio that may be looked at after each case) that at least this share
    of all cases meets a requirement.

    cases, missed  so many were run, and so many of these missed it: numbers of one shape
    """
    return _mixture(np.asarray(cases, float), np.asarray(missed, float), 1.0 - share)


def evidence_against(cases: np.ndarray, missed: np.ndarray, share: float) -> np.ndarray:
    """The logarithm of the evidence (a likelihood ratio that may be looked at after each case) that less than this
    share of all cases meets a requirement."""
    cases, missed = np.asarray(cases, float), np.asarray(missed, float)
    return _mixture(cases, cases - missed, share)


def _mixture(cases: np.ndarray, counted: np.ndarray, allowed: float) -> np.ndarray:
    """ln of the average likelihood of the counts under shares below `allowed`, over their likelihood at `allowed`."""
    from scipy.special import betainc, betaln

    a, b = WEIGHT, WEIGHT * max(1.0, 4.0 / allowed - 1.0)
    with np.errstate(divide="ignore"):
        average = betaln(counted + a, cases - counted + b) + np.log(betainc(counted + a, cases - counted + b, allowed))
        prior = betaln(a, b) + math.log(betainc(a, b, allowed))
    log_ratio: np.ndarray = average - prior - counted * math.log(allowed) - (cases - counted) * math.log1p(-allowed)
    return log_ratio


SMALLEST = 2.0**-50
"""Resolution of the search for a share."""


@frozen
class DecisionLimits:
    """The numbers of cases at which the test of a share decides, by how many of the cases missed the requirement.

    demonstrates  the fewest cases that demonstrate it if so many of them miss it;  refutes: the most that refute it;
                  [misses], both beyond `at_most` cases where none or all up to there do
    """

    demonstrates: np.ndarray
    refutes: np.ndarray

    def verdicts(self, cases: np.ndarray, missed: np.ndarray) -> np.ndarray:
        """1 where so many cases with so many misses demonstrate the requirement, -1 where they refute it, else 0."""
        misses = np.minimum(missed, len(self.refutes) - 1)
        return (cases >= self.demonstrates[misses]).astype(np.int8) - (cases <= self.refutes[misses])


@lru_cache(256)
def limits(share: float, confidence: float, at_most: int) -> DecisionLimits:
    """The limits of the test of a share, above 0 and below 1, with a confidence, for up to `at_most` cases."""

    def needed(cases: np.ndarray, missed: np.ndarray) -> np.ndarray:
        return _reached(evidence_for, cases, missed, share, confidence)

    def open_again(cases: np.ndarray, missed: np.ndarray) -> np.ndarray:
        return ~_reached(evidence_against, cases, missed, share, confidence)

    enough = 1
    while enough < at_most and open_again(np.array(at_most), np.array(enough)):
        enough = min(2 * enough, at_most)
    misses = np.arange(enough + 1)
    return DecisionLimits(_first(misses, at_most, needed), _first(misses, at_most, open_again) - 1)


def _first(misses: np.ndarray, at_most: int, holds: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """For each number of misses, the fewest cases from that number on for which `holds` is true; `at_most` + 1 for
    none."""
    low, high = misses.copy(), np.full(len(misses), at_most + 1)
    while (low < high).any():
        middle = (low + high) // 2
        holding = holds(middle, misses) | (middle > at_most)
        low, high = np.where(holding, low, np.minimum(middle + 1, high)), np.where(holding, middle, high)
    return high


def _reached(
    evidence: Callable[[np.ndarray, np.ndarray, float], np.ndarray],
    cases: np.ndarray,
    missed: np.ndarray,
    share: float,
    confidence: float,
) -> np.ndarray:
    """True where the evidence (a likelihood ratio that may be looked at after each case) suffices for this
    confidence."""
    return np.asarray(evidence(cases, missed, share) >= -math.log1p(-confidence))


def decided(missed: np.ndarray, share: float, confidence: float) -> tuple[int, Verdict]:
    """The number of cases after which a requirement is decided, and the verdict; all cases and "not shown" where they
    do not decide it.

    missed  for each case, in the order in which they were drawn, whether it missed the requirement
    """
    verdicts = limits(share, confidence, len(missed)).verdicts(np.arange(1, len(missed) + 1), np.cumsum(missed))
    if not verdicts.any():
        return len(missed), "not shown"
    first = int((verdicts != 0).argmax())
    return first + 1, "demonstrated" if verdicts[first] > 0 else "refuted"


def cases_needed(share: float, confidence: float, missed: int = 0) -> int:
    """The fewest cases that demonstrate the share if `missed` of them miss the requirement. Raises ValueError where
    more than `MOST_CASES` were needed."""
    low, high = missed, max(1, 2 * missed)
    while not _reached(evidence_for, np.array(high), np.array(missed), share, confidence):
        low, high = high, 2 * high
        if high > MOST_CASES:
            raise ValueError(f"more than {MOST_CASES} cases")
    while high - low > 1:
        middle = (low + high) // 2
        if _reached(evidence_for, np.array(middle), np.array(missed), share, confidence):
            high = middle
        else:
            low = middle
    return high


def lower_bound(cases: int, missed: int, confidence: float) -> float:
    """The smallest share of all cases that meet the requirement, with this confidence however often the cases were
    looked at; 0 where no share is shown."""
    return _bisected(lambda share: not _reached(evidence_for, np.array(cases), np.array(missed), share, confidence))[0]


def upper_bound(cases: int, missed: int, confidence: float) -> float:
    """The largest share of all cases that meet the requirement, with this confidence however often the cases were
    looked at."""
    return _bisected(
        lambda share: bool(_reached(evidence_against, np.array(cases), np.array(missed), share, confidence))
    )[1]


def _bisected(above: Callable[[float], bool]) -> tuple[float, float]:
    """Two neighbouring shares: `above` is false for the first and true for the second, or the second is 1."""
    low, high = 0.0, 1.0
    while low < (middle := 0.5 * (low + high)) < high and high - low > SMALLEST:
        low, high = (low, middle) if above(middle) else (middle, high)
    return low, high


def percentile_rank(cases: int, share: float, confidence: float) -> int:
    """The rank, from 1 for the smallest value, of the value that bounds a percentile from above with this confidence,
    however often the cases were looked at; 0 where there are too few cases for any of their values to bound it.

    share  of the percentile: the value below which this share of all cases lies
    """
    allowed = int((limits(share, confidence, cases).demonstrates <= cases).sum()) - 1
    return cases - allowed if allowed >= 0 else 0
