"""The choice of cases to verify in an experiment, by counts and the seed alone, so that it is reproducible."""

from __future__ import annotations

import hashlib

import numpy as np

from batch.campaigns.outcomes import CaseOutcomes
from met.distinct import distinct
from met.plan import Experiment

SEEDED = 2
"""Number of cases that the seed chooses among all."""


def chosen(experiment: Experiment, results: CaseOutcomes) -> np.ndarray:
    """Places of the cases to verify, rising, among those that reached their end: the first, the last, the worst of each
    metric, and `SEEDED` more by the seed of the experiment's noise. None where no case did."""
    ends = results.ends()
    if ends is None:
        return np.zeros(0, np.int64)
    places = [*ends, *results.worst_finite()]
    for number in range(SEEDED):
        left = results.done.set - len(set(places))
        if left:
            digest = hashlib.sha256(f"verified {experiment.cases.seed} {number}".encode()).digest()
            places.append(_done_beside(results, places, int.from_bytes(digest[:8], "big") % left))
    return distinct(np.array(places, np.int64))


def _done_beside(results: CaseOutcomes, places: list[int], number: int) -> int:
    """The case of this number among those that reached their end, not counting these places, all of which did."""
    ranks = np.sort(results.done.rank(distinct(np.array(places, np.int64))))
    for rank in ranks.tolist():
        number += rank <= number
    return int(results.done.select(np.array([number]))[0])


def most(metrics: int, cases: int) -> int:
    """The largest number of cases that `chosen` chooses from this many cases with these metrics."""
    return min(cases, 2 + metrics + SEEDED)
