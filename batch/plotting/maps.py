"""Metrics over two parameters: a map of cells where cases fill a grid, else a point a case; beside one another for the
values of a third parameter.

A colour says what a metric is, rising in lightness, so that it reads in grey; stripes, which cases miss what is
required; greys, that there is no number (`cells`). Against another archive: own less theirs, in colours that part at
zero. How far colours reach `batch.queries.colours` says: what lies beyond has a colour of its own, and the bar says how
much.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.plotting import cells, layout, sides
from batch.plotting.cells import DOTTED, STRIPES, infinity
from batch.plotting.layout import FAINT, INK, PictureSheet
from batch.plotting.measured import MapMetric
from batch.plotting.points import RASTERED
from batch.plotting.sides import MapSide
from batch.queries.colours import Reach, reach
from batch.queries.grids import FULL, cells_of, column_levels
from batch.queries.pool import CaseColumn
from met.distinct import distinct
from met.frozen import frozen

RISING, PARTING = "viridis", "RdBu_r"
BELOW, ABOVE = "#8f7ff0", "#f4724d"
"""Colours of values below and above the range of colours, also at the colour bar's pointed ends."""

NOWHERE = "#c9ced3"
"""Background of the cells of a difference, where white means no change."""

RINGS = {STRIPES: "o", DOTTED: "s"}
"""Markers around a point that stand for the stripes and dots of a cell."""

WIDEST = 2.6
"""Largest width of a map on paper, inches: where there is more room, maps stand side by side."""


@frozen
class MapLayout:
    """The axes of all maps, x and y, of which each map holds some of the cases; names of the archives."""

    x: MapSide
    y: MapSide
    cells: np.ndarray
    filled: bool
    several: int
    other: tuple[str, str] | None

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.y.levels.texts), len(self.x.levels.texts)


def plan(x: CaseColumn, y: CaseColumn, third: CaseColumn | None, other: tuple[str, str] | None) -> MapLayout:
    """Sides and cells. Cases fill the grid if most of its cells hold one; else they are points, by their values."""
    if x.role == "choice" and y.role != "choice":
        x, y = y, x
    across, up = sides.side(x), sides.side(y)
    cells = cells_of(across.levels, up.levels)
    occupied = cells[cells >= 0]
    filled = len(distinct(occupied)) > FULL * len(across.levels.texts) * len(up.levels.texts)
    apart = occupied if third is None else occupied * 1000 + column_levels(third.values).places[cells >= 0]
    several = int(np.unique(apart, return_counts=True)[1].max(initial=0))
    if not filled:
        across, up = sides.line(x), sides.line(y)
    return MapLayout(across, up, cells, filled, several, other)


def draw(sheet: PictureSheet, map_layout: MapLayout, metrics: Sequence[MapMetric], third: CaseColumn | None) -> Any:
    """The figure of the maps of some metrics; its heading is left to the caller."""
    every = np.ones(len(map_layout.cells), bool)
    if third is None:
        wide = int(sheet.width / WIDEST) if sheet.width else 2 if len(metrics) < 5 else 3
        columns = max(1, min(len(metrics), wide))
        rows = -(-len(metrics) // columns)
        figure, axes = layout.figure(sheet, columns, [1.0] * rows, tall=True, share_y=True)
        flat = [ax for row in axes for ax in row]
        for ax in flat[len(metrics) :]:
            ax.set_visible(False)
        for ax, metric in zip(flat, metrics, strict=False):
            layout.head(ax, _about(metric, map_layout), sheet, columns)
            _maps(figure, [ax], metric, map_layout, [every], sheet)
    else:
        named = sides.side(third).levels
        columns = len(named.texts)
        figure, axes = layout.figure(sheet, columns, [1.0] * len(metrics), tall=True, share_y=True)
        for index, ax in enumerate(axes[0]):
            value = f"{named.texts[index]} {third.unit}".rstrip()
            layout.head(ax, value if third.words else f"{third.label} = {value}", sheet, columns)
        for row, metric in zip(axes, metrics, strict=True):
            _maps(figure, row, metric, map_layout, [named.places == index for index in range(columns)], sheet)
    _sides(axes, map_layout, sheet)
    layout.legend(figure, _marks(metrics, map_layout), sheet, below=True)
    return figure


def description(map_layout: MapLayout, metrics: Sequence[MapMetric], third: CaseColumn | None) -> str:
    """A description of the cells or points, and for a third parameter the requirement."""
    if not map_layout.filled:
        text = "a point a case"
    elif map_layout.several == 1:
        text = "a cell a case"
    else:
        text = f"up to {map_layout.several:,} cases in a cell, which shows {_stands(metrics, map_layout)}"
    required = [
        metric.about.rpartition(" · ")[2] for metric in metrics if metric.column.limits and map_layout.other is None
    ]
    return "; ".join([text, *(required if third is not None else [])])


def _stands(metrics: Sequence[MapMetric], map_layout: MapLayout) -> str:
    """Words for the case that stands for a cell of a map in which several cases lie."""
    if map_layout.other is not None:
        return "the one that differs most"
    judged = {bool(metric.column.limits) for metric in metrics}
    worst, middle = "the worst by what is required", "the middle one"
    return worst if judged == {True} else middle if judged == {False} else f"{worst}, or {middle} where nothing is"


def _about(metric: MapMetric, map_layout: MapLayout) -> str:
    """The heading of a metric's map: its description, and the number of cases without a finite number."""
    if map_layout.other is not None:
        return metric.column.about or metric.column.label
    return " · ".join(part for part in (metric.about, _lost(metric)) if part)


def _lost(metric: MapMetric) -> str:
    """The number of cases without a finite number, in words."""
    infinite, failed = int(np.isinf(metric.values).sum()), int(metric.failed.sum())
    lacking = int((np.isnan(metric.values) & ~metric.failed).sum())
    named = ((infinite, "infinite in {:,}"), (failed, "failed: {:,}"), (lacking, "no value in {:,}"))
    return ", ".join(text.format(count) for count, text in named if count)


# Colours


def _values(metric: MapMetric, map_layout: MapLayout) -> np.ndarray:
    """The numbers that a map shows, [case]: the metric, or its difference from another archive."""
    return metric.values if map_layout.other is None else metric.difference


def _tones(metric: MapMetric, map_layout: MapLayout, values: np.ndarray) -> tuple[Any, Reach | None]:
    """The matplotlib norm that gives a metric's values, [case], their colours, logarithmic where they span factors; and
    how far the colours reach, None where no value is finite."""
    from matplotlib.colors import LogNorm, Normalize

    limits = [limit.value for limit in metric.column.limits] if map_layout.other is None else []
    far = reach(values, limits, parting=map_layout.other is not None)
    if far is None:
        return Normalize(0.0, 1.0), None
    if far.low == far.high:
        room = 0.05 * (abs(far.low) or 1.0)
        return Normalize(far.low - room, far.high + room), far
    return (LogNorm if far.log else Normalize)(far.low, far.high), far


def _colours(map_layout: MapLayout) -> Any:
    """matplotlib's colour map for metrics, with colours beyond its ends; for differences, one that parts at zero."""
    import matplotlib

    if map_layout.other is not None:
        return matplotlib.colormaps[PARTING]
    return matplotlib.colormaps[RISING].with_extremes(under=BELOW, over=ABOVE)


def _bar(
    figure: Any,
    mapped: Any,
    axes: Sequence[Any],
    metric: MapMetric,
    map_layout: MapLayout,
    sheet: PictureSheet,
    far: Reach,
) -> None:
    """Draw the colour bar, pointed where values lie beyond it, with their number. far: how far its colours reach"""
    ends = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
    extend = ends[far.below > 0, far.above > 0]
    bar = figure.colorbar(mapped, ax=list(axes), pad=0.02, aspect=16, extend=extend, extendfrac=0.05)
    label = metric.label
    if map_layout.other is not None:
        label = f"{metric.column.label}: {map_layout.other[0]} − {map_layout.other[1]}"
        label = layout.with_unit(label, metric.column.unit)
    lines = [layout.two_lines(label, 26), *(text for text in reversed(far.beyond_texts) if text)]
    bar.set_label("\n".join(lines), fontsize=sheet.small)
    bar.outline.set_visible(False)
    if map_layout.other is None:
        for limit in metric.column.limits:
            if mapped.norm.vmin <= limit.value <= mapped.norm.vmax:
                bar.ax.axhline(limit.value, color="white", linewidth=2.4)
                bar.ax.axhline(limit.value, color=INK, linewidth=1.0)


# The maps of one metric


def _maps(
    figure: Any,
    axes: Sequence[Any],
    metric: MapMetric,
    map_layout: MapLayout,
    parts: Sequence[np.ndarray],
    sheet: PictureSheet,
) -> None:
    """A map for each of some parts of the cases, in the same colours."""
    values, count = _values(metric, map_layout), map_layout.shape[0] * map_layout.shape[1]
    striped = _striped(metric, map_layout)
    if map_layout.filled:
        picked = [
            cells.cell_values(
                values,
                metric.worse,
                metric,
                np.where(part, map_layout.cells, -1),
                count,
                striped,
                differs=map_layout.other is not None,
            )
            for part in parts
        ]
        values = np.concatenate([cell_values.values for cell_values in picked])
    norm, far = _tones(metric, map_layout, values)
    mapped = None
    for number, (ax, part) in enumerate(zip(axes, parts, strict=True)):
        ax.grid(False)
        if map_layout.other is not None:
            ax.set_facecolor(NOWHERE)
        for name, side in (("x", map_layout.x), ("y", map_layout.y)):
            if side.scale == "log":
                getattr(ax, f"set_{name}scale")("log")
            getattr(ax, f"set_{name}lim")(side.edges[0], side.edges[-1])
        if map_layout.filled:
            mapped = cells.draw(ax, picked[number], map_layout.x, map_layout.y, _colours(map_layout), norm, sheet)
        else:
            mapped = _points(ax, metric, map_layout, part, norm)
    if far is not None:
        _bar(figure, mapped, axes, metric, map_layout, sheet, far)


def _striped(metric: MapMetric, map_layout: MapLayout) -> list[tuple[np.ndarray, str]]:
    """The cases that are drawn with stripes or dots, [case], by pattern: those that miss a requirement, or have
    changed."""
    if map_layout.other is None or metric.theirs_missed is None:
        return [(metric.missed, STRIPES)]
    both = metric.both
    return [
        (both & metric.missed & ~metric.theirs_missed, STRIPES),
        (both & ~metric.missed & metric.theirs_missed, DOTTED),
    ]


def _points(ax: Any, metric: MapMetric, map_layout: MapLayout, part: np.ndarray, norm: Any) -> Any:
    """Draw the cases of this part as coloured points; returns the mappable for a colour bar."""
    values = _values(metric, map_layout)
    x, y = map_layout.x.of_cases(), map_layout.y.of_cases()
    finite = part & np.isfinite(values)
    size = 22.0 if part.sum() < 400 else 8.0
    style: dict[str, Any] = {"s": size, "rasterized": int(part.sum()) > RASTERED}
    mapped = ax.scatter(
        x[finite], y[finite], c=values[finite], cmap=_colours(map_layout), norm=norm, linewidths=0, **style
    )
    for marked, hatch in _striped(metric, map_layout):
        rings = finite & marked
        ax.scatter(x[rings], y[rings], marker=RINGS[hatch], facecolors="none", edgecolors=INK, linewidths=0.8, **style)
    for marked, marker in (
        (part & np.isnan(values), "x"),
        (part & np.isposinf(values), infinity()),
        (part & np.isneginf(values), infinity("−∞")),
    ):
        if marked.any():
            ax.scatter(x[marked], y[marked], marker=marker, color=FAINT, linewidths=0.8, **style)
    return mapped


# Texts


def _sides(axes: Sequence[Sequence[Any]], map_layout: MapLayout, sheet: PictureSheet) -> None:
    """Write values and names of the parameters, on the left and below all."""
    width, height = axes[0][0].figure.get_size_inches()
    across = max(0.6, width / len(axes[0]) - (0.9 if sheet.paper else 1.5))
    up = max(0.5, height / len(axes) - 0.6)
    sides.write(axes[0][0].xaxis, map_layout.x, across, sheet, upright=False, cells=map_layout.filled)
    sides.write(axes[0][0].yaxis, map_layout.y, up, sheet, upright=True, cells=map_layout.filled)
    for number, row in enumerate(axes):
        for column, ax in enumerate(row):
            last = all(not later[column].get_visible() for later in axes[number + 1 :])
            ax.set_xlabel(map_layout.x.label if last else "")
            ax.tick_params(labelbottom=last, labelleft=column == 0, top=False, right=False)
            ax.set_ylabel(layout.two_lines(map_layout.y.label, 22) if column == 0 else "")


def _marks(metrics: Sequence[MapMetric], map_layout: MapLayout) -> dict[str, Any]:
    """Legend entries of the stripes, greys and signs that are there."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    out: dict[str, Any] = {}

    def patch(hatch: str) -> Any:
        return Patch(facecolor="none", edgecolor=INK, linewidth=0.0, hatch=hatch)

    def dot(marker: Any, **style: Any) -> Any:
        return Line2D([], [], linestyle="", marker=marker, color=INK, **style)

    def signed(tone: str, marker: Any, **style: Any) -> Any:
        sign = dot(marker, **style)
        return (Patch(facecolor=tone), sign) if map_layout.filled else sign

    stripes = [marked for metric in metrics for marked in _striped(metric, map_layout)]
    texts = (
        ["misses what is required"]
        if map_layout.other is None
        else [f"missed in {name} alone" for name in map_layout.other]
    )
    for hatch, text in zip((STRIPES, DOTTED), texts, strict=False):
        if any(marked.any() for marked, which in stripes if which == hatch):
            out[text] = patch(hatch) if map_layout.filled else dot(RINGS[hatch], markerfacecolor="none", markersize=5)
    values_of = [_values(metric, map_layout) for metric in metrics]
    if any(np.isinf(values).any() for values in values_of):
        down = not any(np.isposinf(values).any() for values in values_of)
        out["infinite"] = signed(cells.INFINITE, infinity("−∞" if down else "∞"), markersize=9, markeredgewidth=0.0)
    if any(metric.failed.any() for metric in metrics):
        out["failed"] = signed(cells.FAILED, "x", markersize=4.5)
    both = metrics[0].both if metrics else True
    empty = len(distinct(map_layout.cells[both & (map_layout.cells >= 0)])) < np.prod(map_layout.shape)
    if map_layout.filled and any(_lacking(values, metric) for values, metric in zip(values_of, metrics, strict=True)):
        out["no value"] = Patch(facecolor=cells.LACKING)
    if map_layout.filled and empty:
        tone = "white" if map_layout.other is None else NOWHERE
        out["no case" if map_layout.other is None else "not in both"] = Patch(
            facecolor=tone, edgecolor=FAINT, linewidth=0.6
        )
    return out


def _lacking(values: np.ndarray, metric: MapMetric) -> bool:
    """True if a case that exists and did not fail has no value."""
    return bool(np.isnan(values[metric.both & ~metric.failed]).any())
