"""Metrics over varied parameters: points over one parameter, maps over two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile
from batch.plotting import layout, maps, points
from batch.plotting.against import OtherGroup, file_names
from batch.plotting.layout import PictureSheet
from batch.plotting.measured import MapMetric, map_metrics
from batch.plotting.requests import colour_column, is_independent, map_axes
from batch.queries.pool import CaseColumn, Pool
from met.diagnostic import Problem, error
from met.outputs import quoted


def draw(
    archive: ArchiveFile,
    pool: Pool,
    names: Sequence[str],
    parameters: Sequence[str],
    sheet: PictureSheet,
    others: Mapping[int, OtherGroup],
    other: ArchiveFile | None,
) -> Any:
    """The figure. names: of metrics, all for none; parameters: what they are drawn over, none: as is best. others: by
    number of a group of the pool that of the other archive. Raises Problem E327, E390, E393."""
    axes_columns = map_axes(archive, pool, parameters)
    if not pool.metrics():
        helps = "`--histories all` keeps histories; a `metric` in the deck gives a number a case"
        message = f"nothing to draw in `{pool.name}`: it has neither histories nor metrics"
        raise Problem(error("E327", message, help=helps))
    if pool.count < 2:
        message = f"nothing to draw in `{pool.name}`: the metrics of one case are single numbers"
        raise Problem(error("E327", message, help=f"`met show {quoted(archive.path)}` tells them"))
    metrics, left = layout.as_many_as_fit(map_metrics(pool, names, others), bool(names), "metrics")
    files = file_names(archive.path, other.path) if other is not None else None
    count = f"{pool.count:,} cases"
    matched = sum(int((other_group.places >= 0).sum()) for other_group in others.values())
    if files is not None and matched < pool.count:
        count += f", {matched:,} of them also in {files[1]}"
    if len(axes_columns) < 2:
        by = colour_column(pool, axes_columns) if axes_columns else None
        figure = _points(pool, metrics, axes_columns[0] if axes_columns else None, by, sheet, files)
        drawn = {column.key for column in (*axes_columns, by) if column is not None}
        besides = [
            column.label
            for column in pool.varied()
            if column.key not in drawn and is_independent(column, axes_columns[0])
        ]
        below = f"{count}; {' and '.join(besides)} varied too" if besides else count
    else:
        if files is not None:
            metrics = [metric for metric in metrics if metric.theirs is not None]
        third = axes_columns[2] if len(axes_columns) > 2 else None
        planned = maps.plan(axes_columns[0], axes_columns[1], third, files)
        figure, _ = maps.draw(sheet, planned, metrics, third)
        below = f"{count}: {maps.description(planned, metrics, third)}"
    below = f"{below}; {left}" if left else below
    layout.title(figure, archive, pool.groups[0].name if len(pool.groups) == 1 else pool.name, below, sheet)
    return figure


def _points(
    pool: Pool,
    metrics: Sequence[MapMetric],
    x: CaseColumn | None,
    by: CaseColumn | None,
    sheet: PictureSheet,
    files: tuple[str, str] | None,
) -> Any:
    """Draw a panel for each metric."""
    x = x or CaseColumn("case", "case", "", "case", pool.cases.astype(np.float64))
    figure, axes = layout.figure(sheet, 1, [1.0] * len(metrics))
    mapped = None
    for metric, [ax] in zip(metrics, axes, strict=True):
        mapped = points.scatter(ax, metric, x, by, sheet)
        text = " · ".join(part for part in (metric.about, points.edge_words(metric.values)) if part)
        layout.head(ax, text, sheet, 1)
        ax.set_ylabel(layout.two_lines(metric.label))
        points.varied_axis(ax, x, sheet)
    axes[-1][0].set_xlabel(f"{x.label}  ({x.unit})" if x.unit else x.label)
    if mapped is not None and by is not None:
        points.bar(figure, mapped, [ax for [ax] in axes], by, sheet)
    layout.legend(figure, points.legend_of(layout.legend_entries(axes), files), sheet)
    return figure
