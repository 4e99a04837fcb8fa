"""What came of an archive's cases, in numbers: the verdict that `met run` prints and `met show` repeats."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, Group
from met.frozen import frozen


@frozen
class Failure:
    """A case that did not reach its end."""

    row: int
    case_id: str
    cause: str


@frozen
class MetricSummary:
    """A metric over the cases that have one: how many, and the spread of the finite ones (SI).

    infinite  cases where it is infinite (a settling time that never comes);  unknown  where it is not a number
    """

    name: str
    unit: str
    about: str
    minimum: float
    median: float
    maximum: float
    infinite: int
    unknown: int


@frozen
class RequirementSummary:
    """How many cases meet a requirement, miss it, and leave it open because they failed."""

    text: str
    met: int
    missed: int
    unknown: int


@frozen
class Summary:
    """One experiment's outcome. failures: a few of them, unlike ones first."""

    name: str
    cases: int
    failed: int
    recorded: int
    failures: tuple[Failure, ...]
    metrics: tuple[MetricSummary, ...]
    requirements: tuple[RequirementSummary, ...]

    @property
    def ok(self) -> bool:
        """Whether every case reached its end and met every requirement."""
        return self.failed == 0 and all(r.met == self.cases for r in self.requirements)


SHOWN_FAILURES = 5


def summarise(archive: ArchiveFile) -> tuple[Summary, ...]:
    """The outcome of every experiment of an archive."""
    return tuple(summary_of(group) for group in archive.groups)


def summary_of(group: Group) -> Summary:
    """The outcome of one experiment."""
    failed = np.flatnonzero(group.values("status") != 0)
    failures: tuple[Failure, ...] = ()
    if len(failed):
        rows, ids, causes = group.values("case"), group.values("case_id"), group.values("cause")
        failures = tuple(Failure(int(rows[i]), str(ids[i]), str(causes[i])) for i in _one_of_each(causes, failed))
    requirements: tuple[RequirementSummary, ...] = ()
    if "met" in group.variables:
        met = group.values("met")
        requirements = tuple(
            RequirementSummary(str(text), *(int((met[:, i] == value).sum()) for value in (1, 0, -1)))
            for i, text in enumerate(group.values("requirement"))
        )
    return Summary(
        name=group.name,
        cases=group.count,
        failed=len(failed),
        recorded=group.recorded,
        failures=failures,
        metrics=tuple(_metric(v.name, v.unit, v.long_name, group.values(v.name)) for v in group.role("metric")),
        requirements=requirements,
    )


def _one_of_each(causes: np.ndarray, failed: np.ndarray) -> list[int]:
    """The first few failed cases, unlike ones first: a cause without its numbers is what counts as alike."""
    first: dict[str, int] = {}
    for position in failed.tolist():
        kind = "".join(c for c in str(causes[position]).partition(": ")[2] if not c.isdigit())
        first.setdefault(kind, position)
        if len(first) >= SHOWN_FAILURES:
            break
    more = [int(i) for i in failed[:SHOWN_FAILURES] if i not in first.values()]
    return sorted([*first.values(), *more][:SHOWN_FAILURES])


def _metric(name: str, unit: str, about: str, values: np.ndarray) -> MetricSummary:
    finite = np.sort(values[np.isfinite(values)])
    low, middle, high = (finite[0], _median(finite), finite[-1]) if len(finite) else (np.nan,) * 3
    infinite, unknown = int(np.isinf(values).sum()), int(np.isnan(values).sum())
    return MetricSummary(name, unit, about, float(low), float(middle), float(high), infinite, unknown)


def _median(rising: np.ndarray) -> float:
    """The median of sorted numbers; numpy's own takes 60 ms to import."""
    half = len(rising) // 2
    return float(rising[half] if len(rising) % 2 else 0.5 * (rising[half - 1] + rising[half]))


def as_json(summary: Summary) -> dict[str, Any]:
    """Plain data for `--format json`; a number that is not finite is null."""
    from dataclasses import asdict

    data: dict[str, Any] = _finite(asdict(summary))
    return {**data, "ok": summary.ok}


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
