"""What is required of an archive's cases: which requirements there are, which cases meet them, and by how far others
miss them."""

from __future__ import annotations

import numpy as np

from batch.archive.read import Group
from met.frozen import frozen
from met.run import DONE


@frozen
class Required:
    """A requirement: its text and place among the group's, the metric's variable, `<` or `>` with or without `=`, and
    the limit in SI."""

    text: str
    place: int
    metric: str
    comparison: str
    limit: float


def texts(group: Group) -> list[str]:
    """The requirements as the deck wrote them."""
    return [str(text) for text in group.values("requirement")] if "requirement" in group.variables else []


def required(group: Group) -> list[Required]:
    """The requirements of which the archive says all of this; none in an archive that does not say."""
    known = texts(group)
    if not known:
        return []
    told = group.variables["requirement"].attributes
    given = (told.get(name, []) for name in ("metric", "comparison", "limit"))
    metrics, comparisons, limits = (value if isinstance(value, list) else [value] for value in given)
    if not len(metrics) == len(comparisons) == len(limits) == len(known):
        return []
    there = {variable.name for variable in group.role("metric")}
    return [
        Required(text, place, str(metric), str(comparison), limit)
        for place, (text, metric, comparison, limit) in enumerate(zip(known, metrics, comparisons, limits, strict=True))
        if metric in there and isinstance(limit, float)
    ]


def outcomes(group: Group, positions: np.ndarray | None = None) -> np.ndarray:
    """(case, requirement): 1 met, 0 missed, -1 unknown; of all cases or of some."""
    if "met" not in group.variables:
        return np.zeros((group.count if positions is None else len(positions), 0), np.int8)
    return group.values("met") if positions is None else group.at("met", positions)


def beyond(values: np.ndarray, comparison: str, limit: float) -> np.ndarray:
    """How far a metric's values are beyond a limit, relative to it (to the largest value where it is 0); what is not a
    number is infinitely."""
    finite = values[np.isfinite(values)]
    scale = abs(limit) or float(np.abs(finite).max(initial=0.0)) or 1.0
    far = (values - limit if comparison.startswith("<") else limit - values) / scale
    return np.where(np.isnan(far), np.inf, far)


def worst_first(status: np.ndarray, met: np.ndarray, far: np.ndarray) -> np.ndarray:
    """Places of the cases: failed ones, then those that miss most requirements, then by how far they miss.

    met  (case, requirement), as `outcomes`;  far: how far a case is beyond the limit that it misses most, as `beyond`
    A case that meets all requirements stands by how close it comes to one; without requirements the order is the case
    table's.
    """
    keys = [np.arange(len(status))]
    if met.shape[1]:
        keys += [-far, -(met != 1).sum(axis=1)]
    return np.lexsort((*keys, status == DONE))
