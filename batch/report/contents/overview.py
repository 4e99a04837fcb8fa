"""The cases as points of a plot, with the choice of points and of the first axes; and as maps over two parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from batch.differences.compare import VERDICTS
from batch.queries.colours import reach
from batch.queries.grids import ROUND, Levels, cell_cases, cells_of, column_levels, edges_of, is_grid, round_numbers
from batch.queries.pool import ENDED, CaseColumn, Pool
from batch.queries.signals import number_text
from batch.report.contents.against import GOOD, EarlierCases, change
from batch.report.contents.parts import Map, Overview, Ruler
from met.distinct import distinct
from met.run import DONE

MOST_POINTS = 12_000
"""Largest number of cases in a page. Among more, those are left out that lie on a dot with another one."""

DOTS = (1600, 500)
"""Dots of a plot, across and up, told apart where there is room for it (as batch/plotting/points.py has it)."""

MOST_CAUSES = 300
KEPT = 200
"""Number of the worst cases that are always drawn."""


def overview(pool: Pool, before: EarlierCases | None = None) -> Overview | None:
    """The points of a sweep; None where there is one case, or no metric. before: its cases in the archive it is
    compared with."""
    metrics, varied = pool.metrics(), pool.varied()
    if pool.count < 2 or not metrics:
        return None
    table = CaseColumn("case", "case", "", "case", pool.cases.astype(float))
    against = (*varied, *(() if len(varied) > 1 else (table,)))
    changes: tuple[CaseColumn, ...] = ()
    if before is not None:
        metrics = tuple(replace(column, before=before.values(column)) for column in metrics)
        changes = tuple(column for column in map(change, metrics) if column is not None)
    places, dots = _drawn(pool, against, metrics, _noted(pool, before, changes))
    compared = _compared(pool, before) if before is not None else ()
    columns = tuple(_selected(column, places) for column in (*against, *compared, *metrics, *changes))
    note = ""
    if len(places) < pool.count:
        where = f"one of {dots[0]} × {dots[1]} dots of the plot" if dots else "the same dot of the plot"
        note = (
            f"{len(places):,} of {pool.count:,} cases are drawn. Where several lie on {where}, one stands for them; "
            f"a case that lies alone is always drawn, and so are the {KEPT} worst."
        )
    failed = [n for n, place in enumerate(places) if ENDED[pool.ended[place]] in ("failed", "timed out", "lost")]
    causes = pool.texts("cause", places[failed[:MOST_CAUSES]])
    judged = max(metrics, key=lambda column: _interest(pool, column))
    return Overview(
        cases=pool.cases[places],
        ids=tuple(text[:8] for text in pool.texts("case_id", places)),
        ended=pool.ended[places],
        columns=columns,
        causes=dict(zip(failed, causes, strict=False)),
        total=pool.count,
        start=(against[0].key, judged.key, varied[1].key if len(varied) > 1 else ""),
        maps=maps(pool, varied, (*metrics, *changes)),
        note=note,
    )


def _interest(pool: Pool, column: CaseColumn) -> tuple[bool, int]:
    """The rank of a metric to be drawn first: it has a requirement, and cases do not meet it."""
    outcomes = [pool.outcomes[:, pool.requirements.index(limit.text)] for limit in column.limits]
    return bool(outcomes), max((int((outcome == 0).sum()) for outcome in outcomes), default=0)


def _selected(column: CaseColumn, places: np.ndarray) -> CaseColumn:
    before = None if column.before is None else column.before[places]
    return replace(column, values=column.values[places], before=before)


def _compared(pool: Pool, before: EarlierCases) -> tuple[CaseColumn, ...]:
    """Columns that compare each case with the other archive: the verdict of `met diff`, and whether it meets the
    requirements."""
    verdicts = (*VERDICTS[:3], "only now")
    how = np.where(before.in_both, before.how, len(verdicts) - 1).astype(float)
    yes, no = ("meets all", "does not") if pool.requirements else ("reaches its end", "does not")
    words = (f"{yes}, and did not", f"{yes}, as before", f"{no}, as before", f"{no}, and did", "only now")
    was, now = np.isin(before.ended, GOOD), np.isin(pool.ended, GOOD)
    flow = np.where(now, np.where(was, 1, 0), np.where(was, 3, 2))
    flow = np.where(before.in_both, flow, len(words) - 1).astype(float)
    return (
        CaseColumn("choice:compared", "compared with before", "", "choice", how, verdicts),
        CaseColumn("choice:outcome", "outcome, now and before", "", "choice", flow, words),
    )


def _noted(pool: Pool, before: EarlierCases | None, changes: tuple[CaseColumn, ...]) -> np.ndarray:
    """Places of the cases that are drawn because they changed: those that changed most, and in each metric the
    extremes; and the first of those that now miss a requirement, or now meet it."""
    if before is None:
        return np.zeros(0, np.int64)
    was, now = np.isin(before.ended, GOOD), np.isin(pool.ended, GOOD)
    out = [np.flatnonzero(np.isin(pool.cases, before.most))]
    out += [np.flatnonzero(before.in_both & other)[:KEPT] for other in (was & ~now, now & ~was)]
    out += [_extremes(column) for column in changes]
    return np.concatenate(out)


def _extremes(column: CaseColumn) -> np.ndarray:
    numbers = np.flatnonzero(np.isfinite(column.values))
    return numbers[[column.values[numbers].argmin(), column.values[numbers].argmax()]] if len(numbers) else numbers


def _drawn(
    pool: Pool, against: tuple[CaseColumn, ...], metrics: tuple[CaseColumn, ...], noted: np.ndarray
) -> tuple[np.ndarray, tuple[int, ...]]:
    """Places of the cases to draw, including the noted ones, and the resolution in dots by which they were chosen.

    Of every metric against every parameter each dot that any case lies on has a case, the worst of those on it; and the
    extremes of each metric are there. Where that makes too many, dots are made larger.
    """
    if pool.count <= MOST_POINTS:
        return np.arange(pool.count), ()
    rank = np.empty(pool.count, np.int64)
    rank[pool.worst_first] = np.arange(pool.count)
    always = [pool.worst_first[:KEPT], noted, *map(_extremes, metrics)]
    across, up = DOTS
    while True:
        drawn = [_on_dots(x.values, y.values, rank, across, up) for x in against for y in metrics]
        places = distinct(np.concatenate([*always, *drawn]))
        if len(places) <= MOST_POINTS or (across, up) == (1, 1):
            return places, (across, up)
        across, up = max(1, across * 4 // 5), max(1, up * 4 // 5)


def _on_dots(x: np.ndarray, y: np.ndarray, rank: np.ndarray, across: int, up: int) -> np.ndarray:
    """The case of lowest rank on each dot. Values that are not finite have dots of their own, beside the others."""
    dots = _strips(x, across) * (up + 4) + _strips(y, up)
    order = np.argsort(rank, kind="stable")
    return order[np.unique(dots[order], return_index=True)[1]]


def _strips(values: np.ndarray, count: int) -> np.ndarray:
    """The stretch, of `count` equal ones, in which each value lies; then one each for inf, -inf and not-a-number."""
    finite = np.isfinite(values)
    out = np.full(len(values), count + 3)
    low, high = values[finite].min(initial=np.inf), values[finite].max(initial=-np.inf)
    span = high - low if np.isfinite(high - low) and high > low else 1.0
    out[finite] = np.minimum((count * ((values[finite] - low) / span)).astype(np.int64), count)
    out[np.isposinf(values)], out[np.isneginf(values)] = count + 1, count + 2
    return out


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
