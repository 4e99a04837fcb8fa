"""Which cases of an experiment are verified: by counts and the seed alone, so the same ones each time."""

from __future__ import annotations

import hashlib

import numpy as np

from batch.campaigns.keep import CaseOutcomes, worst
from met.distinct import distinct
from met.plan import Experiment
from met.run import DONE

SEEDED = 2
"""Cases that the seed chooses among all."""


def chosen(experiment: Experiment, results: CaseOutcomes) -> np.ndarray:
    """Places of the cases to verify, rising, among those that reached their end: the first, the last, the worst of each
    metric, and `SEEDED` more by the seed of the experiment's noise. None where no case did."""
    done = np.flatnonzero(results.status == DONE)
    if not len(done):
        return done
    places = [int(done[0]), int(done[-1])]
    for name, values in results.metrics.items():
        ranked = worst(experiment, name, np.where(np.isfinite(values), values, np.nan))
        places += ranked[:1].tolist()
    for number in range(SEEDED):
        left = done[~np.isin(done, places)]
        if len(left):
            digest = hashlib.sha256(f"verified {experiment.cases.seed} {number}".encode()).digest()
            places.append(int(left[int.from_bytes(digest[:8], "big") % len(left)]))
    return distinct(np.array(places, np.int64))


def most(metrics: int, cases: int) -> int:
    """The largest number of cases that `chosen` may choose of so many cases with so many metrics."""
    return min(cases, 2 + metrics + SEEDED)
