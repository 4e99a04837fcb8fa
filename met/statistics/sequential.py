"""A test of a share of cases that may be looked at after every case: it stops as soon as the cases decide.

A bound for a fixed number of cases does not hold for who looks as they come in and stops when it is reached: at 90 %
confidence more than one campaign in three would say "demonstrated" of a requirement that is not met. What holds is a
process that is a nonnegative supermartingale where the requirement is not met, so that it ever exceeds 1 / (1 -
confidence) with a probability of at most 1 - confidence (J. Ville, 1939): an e-process (A. Ramdas, P. Grunwald, V. Vovk
and G. Shafer, Statistical Science 38 (2023) 576-601). Here it is the likelihood of the cases under shares of misses
that meet the requirement, averaged over a beta distribution that is cut off at the share allowed, against their
likelihood at the share allowed; and the same on the other side for "refuted".
"""

from __future__ import annotations

import math

import numpy as np

from met.statistics.confidence import Verdict

WEIGHT = 0.5
"""First parameter of the beta distribution of shares of misses: Jeffreys'; the second has the mean at a quarter of the
share allowed."""


def evidence_for(cases: np.ndarray, missed: np.ndarray, share: float) -> np.ndarray:
    """The logarithm of the evidence that at least this share of all cases meets a requirement.

    cases, missed  so many were run, and so many of these missed it: numbers of one shape
    """
    return _mixture(np.asarray(cases, float), np.asarray(missed, float), 1.0 - share)


def evidence_against(cases: np.ndarray, missed: np.ndarray, share: float) -> np.ndarray:
    """The logarithm of the evidence that less than this share of all cases meets a requirement."""
    cases, missed = np.asarray(cases, float), np.asarray(missed, float)
    return _mixture(cases, cases - missed, share)


def _mixture(cases: np.ndarray, counted: np.ndarray, allowed: float) -> np.ndarray:
    """ln of the average likelihood under shares below `allowed` of what is counted, over the likelihood at it."""
    from scipy.special import betainc, betaln

    a, b = WEIGHT, WEIGHT * max(1.0, 4.0 / allowed - 1.0)
    with np.errstate(divide="ignore"):
        average = betaln(counted + a, cases - counted + b) + np.log(betainc(counted + a, cases - counted + b, allowed))
        prior = betaln(a, b) + math.log(betainc(a, b, allowed))
    found: np.ndarray = average - prior - counted * math.log(allowed) - (cases - counted) * math.log1p(-allowed)
    return found


def decided(missed: np.ndarray, share: float, confidence: float) -> tuple[int, Verdict]:
    """The number of cases after which a requirement is decided, and how; all, and "not shown", where they do not do it.

    missed  for each case, in the order in which they were drawn, whether it missed the requirement
    """
    cases, so_far = np.arange(1, len(missed) + 1), np.cumsum(missed)
    limit = -math.log1p(-confidence)
    for_it, against = (evidence(cases, so_far, share) >= limit for evidence in (evidence_for, evidence_against))
    first = [int(each.argmax()) if each.any() else len(missed) for each in (for_it, against)]
    if min(first) == len(missed):
        return len(missed), "not shown"
    return min(first) + 1, "demonstrated" if first[0] < first[1] else "refuted"
