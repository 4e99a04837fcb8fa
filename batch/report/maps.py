"""Two parameters that make a grid, and what a metric is in each cell of it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from batch.colours import reach
from batch.grids import cells_of, is_grid, levelled, standing
from batch.pool import Column, Pool
from batch.report.content import Map
from met.run import DONE

MOST_MAPS = 6


def maps(pool: Pool, varied: Sequence[Column], metrics: Sequence[Column]) -> tuple[Map, ...]:
    """A map for each two parameters that make a grid, those first that have most values."""
    out: list[Map] = []
    for x, y in combinations(varied, 2):
        if len(out) == MOST_MAPS:
            break
        if x.role == "choice" and y.role != "choice":
            x, y = y, x
        if is_grid(x.values, y.values):
            out.append(_map(pool, x, y, metrics))
    return tuple(out)


def _map(pool: Pool, x: Column, y: Column, metrics: Sequence[Column]) -> Map:
    across, up = levelled(x.values, x.words), levelled(y.values, y.words)
    shape = (len(up.texts), len(across.texts))
    cells = cells_of(across, up)
    there, done = cells >= 0, pool.status == DONE
    values, cases, missed, reaches = {}, {}, {}, {}
    for column in metrics:
        chosen = standing(column.values, cells, shape[0] * shape[1], column.limits[0].sense if column.limits else "")
        has = chosen >= 0
        values[column.key] = np.where(has, column.values[chosen], np.nan).reshape(shape)
        limits = [limit.value for limit in column.limits]
        reaches[column.key] = reach(values[column.key], limits, parting=column.role == "change")
        cases[column.key] = np.where(has, pool.cases[chosen], -1).reshape(shape)
        out = np.zeros(pool.count, bool)
        for limit in column.limits:
            out |= pool.outcomes[:, pool.requirements.index(limit.text)] == 0
        missed[column.key] = np.bincount(cells[there & out], minlength=shape[0] * shape[1]).reshape(shape)
    counts, failed = (
        np.bincount(cells[which], minlength=shape[0] * shape[1]).reshape(shape) for which in (there, there & ~done)
    )
    return Map(x.key, y.key, across.texts, up.texts, counts, values, cases, missed, failed, reaches)
