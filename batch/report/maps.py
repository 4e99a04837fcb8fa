"""Two parameters that make a grid, and what a metric is in each cell of it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np

from batch.report.content import Column, Map
from batch.report.pool import Pool, levels, shown

MOST_LEVELS = 48
"""Rows and columns of a map; more values share them, in equal stretches."""

MOST_MAPS = 6
FULL = 0.5
"""A grid has cases in more than this share of its cells: two parameters that go in step make none."""


def maps(pool: Pool, varied: Sequence[Column], metrics: Sequence[Column]) -> tuple[Map, ...]:
    """A map for each two parameters that make a grid, those first that have most values."""
    out: list[Map] = []
    for x, y in combinations(varied, 2):
        if len(out) == MOST_MAPS:
            break
        if x.role == "choice" and y.role != "choice":
            x, y = y, x
        if _is_grid(x.values, y.values):
            out.append(_map(pool, x, y, metrics))
    return tuple(out)


def _is_grid(x: np.ndarray, y: np.ndarray) -> bool:
    """Whether most of the combinations of two parameters' values are among the cases."""
    good = np.isfinite(x) & np.isfinite(y)
    x_levels, y_levels = levels(x), levels(y)
    if len(x_levels) < 2 or len(y_levels) < 2 or len(x_levels) * len(y_levels) > 2 * good.sum():
        return False
    cells = np.searchsorted(x_levels, x[good]) * len(y_levels) + np.searchsorted(y_levels, y[good])
    return len(np.unique(cells)) > FULL * len(x_levels) * len(y_levels)


def _map(pool: Pool, x: Column, y: Column, metrics: Sequence[Column]) -> Map:
    x_texts, across = _levels(x)
    y_texts, up = _levels(y)
    shape = (len(y_texts), len(x_texts))
    there = (across >= 0) & (up >= 0)
    cells = np.where(there, up * shape[1] + across, -1)
    values, cases, missed = {}, {}, {}
    for column in metrics:
        chosen = _chosen(column, cells, shape[0] * shape[1])
        has = chosen >= 0
        values[column.key] = np.where(has, column.values[chosen], np.nan).reshape(shape)
        cases[column.key] = np.where(has, pool.cases[chosen], -1).reshape(shape)
        out = np.zeros(pool.count, bool)
        for limit in column.limits:
            out |= pool.outcomes[:, pool.requirements.index(limit.text)] == 0
        missed[column.key] = np.bincount(cells[there & out], minlength=shape[0] * shape[1]).reshape(shape)
    counts = np.bincount(cells[there], minlength=shape[0] * shape[1]).reshape(shape)
    return Map(x.key, y.key, x_texts, y_texts, counts, values, cases, missed)


def _levels(column: Column) -> tuple[tuple[str, ...], np.ndarray]:
    """The levels in words, and of each case which it has; -1 where the value is no number."""
    found = levels(column.values)
    finite = np.isfinite(column.values)
    places = np.full(len(column.values), -1)
    if len(found) <= MOST_LEVELS:
        places[finite] = np.searchsorted(found, column.values[finite])
        texts = [column.words[int(v)] if column.words else shown(float(v)) for v in found]
        return tuple(texts), places
    edges = np.linspace(found[0], found[-1], MOST_LEVELS + 1)
    places[finite] = np.clip(np.searchsorted(edges, column.values[finite], side="right") - 1, 0, MOST_LEVELS - 1)
    texts = [f"{shown(float(a))} … {shown(float(b))}" for a, b in pairwise(edges)]
    return tuple(texts), places


def _chosen(column: Column, cells: np.ndarray, count: int) -> np.ndarray:
    """Of each cell the case that stands for it: the worst by the metric's first limit, or the middle one where there is
    no limit; -1 where no case of it has a value."""
    there = np.flatnonzero((cells >= 0) & ~np.isnan(column.values))
    falls = bool(column.limits) and column.limits[0].sense == ">"
    order = there[np.lexsort((-column.values[there] if falls else column.values[there], cells[there]))]
    first = np.searchsorted(cells[order], np.arange(count))
    end = np.searchsorted(cells[order], np.arange(count), side="right")
    place = end - 1 if column.limits else (first + end - 1) // 2
    if not len(order):
        return np.full(count, -1)
    return np.where(end > first, order[np.clip(place, 0, len(order) - 1)], -1)
