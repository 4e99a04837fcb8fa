"""Changes of required metrics since another archive: away from their limits, which is better, or towards them."""

from __future__ import annotations

import numpy as np

from batch.differences.compare import magnitude
from batch.differences.words import distinct_texts
from batch.queries.pool import CaseColumn, Pool, page_number
from batch.report.contents.against import EarlierCases
from batch.report.contents.parts import MetricMove


def metric_moves(pool: Pool, before: EarlierCases, requirement: str) -> tuple[MetricMove | None, MetricMove | None]:
    """The cases in both archives in which the metric of a requirement is better now, and those in which it is worse.
    Changes within the tolerances, and values that are missing in one of the two, do not count."""
    for column in pool.metrics():
        sense = next((limit.sense for limit in column.limits if limit.text == requirement), None)
        was = None if sense is None else before.values(column)
        if sense is None or was is None:
            continue
        moved = _beyond(pool, before, column)
        lower, higher = (moved & way for way in (column.values < was, column.values > was))
        better_and_worse = (lower, higher) if sense == "<" else (higher, lower)
        return _move(pool, column, was, better_and_worse[0]), _move(pool, column, was, better_and_worse[1])
    return None, None


def _beyond(pool: Pool, before: EarlierCases, column: CaseColumn) -> np.ndarray:
    """True of each case in which a metric differs by more than its structure's tolerances, [case]."""
    name = column.key.partition(":")[2]
    now = pool.gathered(name)
    was = np.where(before.in_both, before.pool.gathered(name)[before.place], np.nan)
    out = np.zeros(pool.count, bool)
    for number, _, experiment in before.pairs:
        diff = next(
            (signal for signal in experiment.signals if signal.metric and signal.name == name and not signal.why), None
        )
        if diff is not None:
            in_both = (pool.group_of == number) & before.in_both
            a, b, allowed = was[in_both], now[in_both], diff.tolerance
            with np.errstate(invalid="ignore", over="ignore"):
                limit = allowed.absolute + allowed.relative * magnitude(a, b)
                out[in_both] = (a != b) & ~(np.abs(b - a) <= limit)
    return out


def _move(pool: Pool, column: CaseColumn, was: np.ndarray, moved: np.ndarray) -> MetricMove | None:
    """The cases that moved, and the one that moved furthest; None where none did."""
    places = np.flatnonzero(moved)
    if not len(places):
        return None
    with np.errstate(over="ignore"):
        furthest = int(places[np.abs(column.values[places] - was[places]).argmax()])
    texts = _texts(float(was[furthest]), float(column.values[furthest]))
    return MetricMove(len(places), int(pool.cases[furthest]), *texts, column.unit)


def _texts(before: float, now: float) -> tuple[str, str]:
    """The two values as a page shows them, or in more digits where these would be the same."""
    texts = page_number(before), page_number(now)
    return texts if texts[0] != texts[1] else distinct_texts(before, now)
