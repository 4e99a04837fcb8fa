"""Maps of metrics over two parameters that make a grid."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from batch.queries.colours import reach
from batch.queries.grids import ROUND, Levels, cell_cases, cells_of, column_levels, edges_of, is_grid, round_numbers
from batch.queries.pool import CaseColumn, Pool
from batch.queries.signals import number_text
from batch.report.contents.parts import Map, Ruler
from met.run import DONE

MOST_MAPS = 6


def maps(pool: Pool, varied: Sequence[CaseColumn], metrics: Sequence[CaseColumn]) -> tuple[Map, ...]:
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


def _map(pool: Pool, x: CaseColumn, y: CaseColumn, metrics: Sequence[CaseColumn]) -> Map:
    """The map of metrics over two parameters: of each cell its case, value, misses and failures."""
    across, up = column_levels(x.values, x.words), column_levels(y.values, y.words)
    shape = (len(up.texts), len(across.texts))
    cells = cells_of(across, up)
    in_cells, done = cells >= 0, pool.status == DONE
    values, cases, missed, reaches = {}, {}, {}, {}
    for column in metrics:
        chosen = cell_cases(column.values, cells, shape[0] * shape[1], column.limits[0].sense if column.limits else "")
        has = chosen >= 0
        values[column.key] = np.where(has, column.values[chosen], np.nan).reshape(shape)
        limits = [limit.value for limit in column.limits]
        reaches[column.key] = reach(values[column.key], limits, parting=column.role == "change")
        cases[column.key] = np.where(has, pool.cases[chosen], -1).reshape(shape)
        bad = cells[in_cells & pool.missed(column)]
        missed[column.key] = np.bincount(bad, minlength=shape[0] * shape[1]).reshape(shape)
    counts, failed = (
        np.bincount(cells[which], minlength=shape[0] * shape[1]).reshape(shape)
        for which in (in_cells, in_cells & ~done)
    )
    return Map(
        x.key, y.key, across.texts, up.texts, counts, values, cases, missed, failed, reaches, ruler(across), ruler(up)
    )


def ruler(levels: Levels) -> Ruler:
    """The positions of values along an axis, by their steps or factors, as in `met plot`: for stretches of values,
    round numbers are written."""
    count = len(levels.texts)
    if levels.scale == "place":
        edges = np.linspace(0.0, 1.0, count + 1)
        heads = [text.partition(" … ")[0] for text in levels.texts]
        return Ruler(tuple(edges.tolist()), (tuple(zip((edges[1:] + edges[:-1]) / 2, heads, strict=True)),))
    ends = levels.values if levels.stretches else edges_of(levels.values, levels.scale)
    low, high = float(ends[0]), float(ends[-1])

    def where(values: np.ndarray) -> np.ndarray:
        if levels.scale == "log":
            return np.asarray(np.log(values / low) / np.log(high / low))
        return (values - low) / (high - low)

    choices = [levels.values] if not levels.stretches else []
    if levels.scale == "log":
        choices += [np.array(round_numbers(low, high, steps)) for steps in ROUND]
    choices = [choice for choice in choices if len(choice) > 1] or [_steps(low, high)]
    if levels.scale == "linear":
        choices.append(_steps(low, high))
    ticks = tuple(
        tuple(zip(where(choice).tolist(), map(number_text, choice.tolist()), strict=True)) for choice in choices
    )
    return Ruler(tuple(where(ends).tolist()), ticks)


def _steps(low: float, high: float) -> np.ndarray:
    """Five to twelve round numbers by equal steps."""
    size = 10.0 ** np.floor(np.log10((high - low) / 5))
    step = next(
        candidate for candidate in (5 * size, 2 * size, size) if (high - low) / candidate > 4.999
    )  # of exactly 5, rounded
    return np.asarray(np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step)
