"""Metrics as distributions: where seeds differ or motion is chaotic, single cases differ by chance, and only their
distributions can be compared.

Each metric is compared by the two-sample test of Kolmogorov and Smirnov; as there are several, the probabilities are
corrected by Holm's method, so that one false alarm among all of them has the stated probability at most.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.queries.summary import spread
from met.frozen import frozen
from met.statistics.significance import holm

LEVEL = 0.01
"""Probability of a false alarm among all metrics of an experiment."""


@frozen
class MetricSamples:
    """One metric in two archives.

    cases        of a and b that have a finite value;  medians: of these;  failures: cases of a and b that have none
    distance     the largest between the two distribution functions
    probability  of such a distance by chance, corrected for the number of metrics
    """

    name: str
    unit: str
    cases: tuple[int, int]
    medians: tuple[float, float]
    failures: tuple[int, int]
    distance: float
    probability: float

    @property
    def unlike(self) -> bool:
        return self.probability < LEVEL


def samples(a: ArchiveGroup, b: ArchiveGroup) -> list[MetricSamples]:
    """Every metric that both have, in the order of the first."""
    from scipy.stats import ks_2samp

    rows = []
    for variable in a.role("metric"):
        if variable.name not in b.variables or b.variables[variable.name].role != "metric":
            continue
        both = [group.values(variable.name) for group in (a, b)]
        finite: Any = [values[np.isfinite(values)] for values in both]
        sizes = len(finite[0]), len(finite[1])
        lost = len(both[0]) - sizes[0], len(both[1]) - sizes[1]
        medians = tuple(spread(values).median for values in both)
        distance, chance = 0.0, 1.0
        if min(sizes) > 0:
            result: Any = ks_2samp(finite[0], finite[1], method="auto" if max(sizes) <= 10_000 else "asymp")
            distance, chance = float(result.statistic), float(result.pvalue)
        rows.append((variable, sizes, medians, lost, distance, chance))
    corrected = holm([row[-1] for row in rows])
    return [
        MetricSamples(variable.name, variable.unit, sizes, (medians[0], medians[1]), lost, distance, chance)
        for (variable, sizes, medians, lost, distance, _), chance in zip(rows, corrected, strict=True)
    ]
