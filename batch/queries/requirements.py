"""The requirements of an archive, the cases that meet them, and the amounts by which others miss them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from batch.archive.read import ArchiveGroup
from met.diagnostic import Place
from met.distinct import distinct
from met.frozen import frozen
from met.plan import Experiment
from met.run import DONE


@frozen
class GroupRequirement:
    """A requirement: its text and place among the group's, the metric's variable, `<` or `>` with or without `=`, and
    the limit in SI; for one over cases the share that must meet it, and the confidence."""

    text: str
    place: int
    metric: str
    comparison: str
    limit: float
    share: float | None = None
    confidence: float | None = None

    @property
    def below(self) -> bool:
        """True if values are to be below the limit."""
        return self.comparison.startswith("<")

    def margin(self, value: float) -> float:
        """The distance from a value of the metric to the limit, SI; negative where the value is beyond it."""
        return (1.0 if self.below else -1.0) * (self.limit - value)

    def written_at(self, experiment: Experiment | None) -> Place | None:
        """The place of the requirement in the deck, from the plan of its experiment; None without that."""
        return None if experiment is None else experiment.requirements[self.place].place


def requirement_texts(group: ArchiveGroup) -> list[str]:
    """The requirements as the deck wrote them."""
    return [str(text) for text in group.values("requirement")] if "requirement" in group.variables else []


def group_requirements(group: ArchiveGroup) -> list[GroupRequirement]:
    """The requirements whose parts the archive stores; none in an older archive that does not."""
    known = requirement_texts(group)
    if not known:
        return []
    attributes = group.variables["requirement"].attributes
    parts = (attributes.get(name, []) for name in ("metric", "comparison", "limit", "share", "confidence"))
    metrics, comparisons, limits, shares, confidences = (
        value if isinstance(value, list) else [value] for value in parts
    )
    if not len(metrics) == len(comparisons) == len(limits) == len(known):
        return []
    shares, confidences = ([*map(_number, values or [math.nan] * len(known))] for values in (shares, confidences))
    metric_names = {variable.name for variable in group.role("metric")}
    return [
        GroupRequirement(text, place, str(metric), str(comparison), limit, share, confidence)
        for place, (text, metric, comparison, limit, share, confidence) in enumerate(
            zip(known, metrics, comparisons, limits, shares, confidences, strict=True)
        )
        if metric in metric_names and isinstance(limit, float)
    ]


def _number(value: float) -> float | None:
    """A number; None for not-a-number, which an archive has where there is no value."""
    return None if math.isnan(value) else value


def outcomes(group: ArchiveGroup, positions: np.ndarray | None = None) -> np.ndarray:
    """The outcome of each requirement in all cases or in some, [case, requirement]: 1 met, 0 missed, -1 unknown."""
    if "met" not in group.variables:
        return np.zeros((group.count if positions is None else len(positions), 0), np.int8)
    return group.values("met") if positions is None else group.at("met", positions)


def beyond(values: np.ndarray, comparison: str, limit: float) -> np.ndarray:
    """The distance of a metric's values beyond a limit, relative to it (to the largest value where it is 0); infinite
    for not-a-number."""
    finite = values[np.isfinite(values)]
    scale = abs(limit) or float(np.abs(finite).max(initial=0.0)) or 1.0
    far = (values - limit if comparison.startswith("<") else limit - values) / scale
    return np.where(np.isnan(far), np.inf, far)


SPREAD = 20
"""Number of places at the head of an order in which equally bad cases are spread over the varied values: as many as a
table shows."""


@frozen
class Ranking:
    """Cases, the worst first. order: their places; tie: the ascending number of each place's tie"""

    order: np.ndarray
    tie: np.ndarray

    def equal(self, most: int) -> int:
        """The number of cases that are as bad as the last of the first `most`, if some of them are not among these;
        else 0."""
        if not 0 < most < len(self.tie) or self.tie[most - 1] != self.tie[most]:
            return 0
        return int((self.tie == self.tie[most - 1]).sum())


def ranking(
    status: np.ndarray, met: np.ndarray, far: np.ndarray, varied: Callable[[np.ndarray], Sequence[np.ndarray]]
) -> Ranking:
    """The cases: failed ones, then those that miss most requirements, then by how far they miss.

    met     (case, requirement), as `outcomes`
    far     how far a case is beyond the limit that it misses most, as `beyond`
    varied  what is varied in the cases at some places, an array each
    A case that meets all requirements stands by how close it comes to one; without requirements the order is the case
    table's. Of equal ones the first few are far from one another in what is varied, the others in the table's order.
    """
    keys = [status == DONE]
    if met.shape[1]:
        keys += [-(met != 1).sum(axis=1), -far]
    order = np.lexsort((np.arange(len(status)), *keys[::-1]))
    unlike = np.zeros(len(order), bool)
    for key in keys:
        unlike[1:] |= key[order[1:]] != key[order[:-1]]
    tie = np.cumsum(unlike)
    judged = met.shape[1] > 0 or not (status == DONE).all()
    for number in distinct(tie[:SPREAD]).tolist() if judged else ():
        first, end = np.searchsorted(tie, [number, number + 1])
        count = min(SPREAD, end) - first
        if end - first > count:
            tied = order[first:end]
            chosen = _spread(varied(tied), len(tied), count)
            order[first:end] = np.concatenate([tied[chosen], np.delete(tied, chosen)])
    return Ranking(order, tie)


def _spread(varied: Sequence[np.ndarray], cases: int, count: int) -> np.ndarray:
    """Places of `count` cases, the first one and then always one that is furthest from those before, by the ranks of
    the varied values."""
    ranks = np.zeros((cases, len(varied)))
    for column, values in enumerate(varied):
        _, place = np.unique(values, return_inverse=True)
        ranks[:, column] = place / max(1, int(place.max(initial=0)))
    chosen = [0]
    far = ((ranks - ranks[0]) ** 2).sum(axis=1)
    while len(chosen) < count:
        far[chosen] = -1.0
        chosen.append(int(far.argmax()))
        far = np.minimum(far, ((ranks - ranks[chosen[-1]]) ** 2).sum(axis=1))
    return np.array(chosen)
