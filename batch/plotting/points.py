"""Metrics over one parameter: a point a case, in the colours of another parameter; curves where these make a grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from batch.plotting import layout
from batch.plotting.layout import COLOURS, FAINT, INK, PictureSheet, sequence
from batch.plotting.measured import MapMetric
from batch.plotting.sides import is_log, line, write_log
from batch.queries.grids import MOST_LEVELS, column_levels, is_grid, levels
from batch.queries.pool import CaseColumn
from met.frozen import frozen

MARKER, NAMED = 14, 8
"""Area of a point, in square points; number of levels that a legend names: with more, there is a colour bar."""

MANY, DOTS = 20_000, (1600, 500)
"""Number of points from which on hidden ones are left out; resolution of a panel, across and up, in dots."""

RASTERED = 2000
"""More points than these are drawn as an image within an SVG or a PDF."""

BEHIND, PALE = 3.0, 0.3

BAR = 0.7
"""Smallest height of a colour bar, relative to the picture."""

PANEL = 0.6
"""Smallest width of a panel beside a legend, relative to the picture."""


@frozen
class Set:
    """The cases of one colour. text: of the legend; joined: whether a curve goes through them."""

    places: np.ndarray
    colour: Any
    text: str
    joined: bool


def scatter(ax: Any, metric: MapMetric, x: CaseColumn, by: CaseColumn | None, sheet: PictureSheet) -> Any:
    """Draw one metric over x, by the levels of another column. Returns the mappable for a colour bar, if one is
    needed."""
    y = np.where(np.isfinite(metric.values), metric.values, np.nan)
    drawn = _apart(x.values, y)
    size = MARKER / marker_scale(len(x.values)) ** 2
    style: dict[str, Any] = {"s": size, "linewidths": 0, "rasterized": len(drawn) > RASTERED}
    mapped = None
    sets = _sets(x, by)
    if by is not None and not any(point_set.text for point_set in sets):
        mapped = _scale(by)
    if not sets and by is not None:
        style |= {"cmap": "viridis", "norm": _scale(by).norm}
        mapped = ax.scatter(x.values[drawn], metric.values[drawn], c=by.values[drawn], **style)
    for point_set in sets:
        own = drawn[np.isin(drawn, point_set.places)] if len(sets) > 1 else drawn
        if point_set.joined:
            order = point_set.places[np.argsort(x.values[point_set.places])]
            ax.plot(x.values[order], y[order], color=point_set.colour, linewidth=1.0)
        ax.scatter(
            x.values[own],
            metric.values[own],
            color=point_set.colour,
            label=layout.legend_label(point_set.text),
            **style,
        )
    if metric.theirs is not None:
        _theirs(ax, metric, x, sets, by)
        _edge(ax, np.where(metric.both, metric.theirs, 0.0), x.values, 4.0 * max(12.0, size), hollow=True)
    _edge(ax, metric.values, x.values, size)
    _limits(ax, metric)
    _reach(ax, x.values)
    return mapped


def _sets(x: CaseColumn, by: CaseColumn | None) -> list[Set]:
    """A set for each level that the legend names; none where there are too many of them and no curves."""
    if by is None:
        every = np.arange(len(x.values))
        return [Set(every, COLOURS[0], "", x.role == "parameter" and len(levels(x.values)) == len(every) < 200)]
    levels_ = column_levels(by.values, by.words)
    count = len(levels_.texts)
    if levels_.stretches or (count > NAMED and not _curves(x, by)):
        return []
    joined = _curves(x, by)
    sets = []
    for index, text in enumerate(levels_.texts):
        colour = COLOURS[index % len(COLOURS)] if by.words else sequence(index, count)
        if count > NAMED:
            colour = _scale(by).to_rgba(levels_.values[index])
        named = text if by.words else f"{by.label} = {text} {by.unit}".rstrip()
        sets.append(Set(np.flatnonzero(levels_.places == index), colour, named if count <= NAMED else "", joined))
    return sets


def _scale(by: CaseColumn) -> Any:
    """Colours by value, where there are too many levels to name; by the logarithm where the axis would be
    logarithmic."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize

    finite = levels(by.values)
    return ScalarMappable((LogNorm if is_log(by) else Normalize)(finite[0], finite[-1]), "viridis")


def _curves(x: CaseColumn, by: CaseColumn) -> bool:
    """True if there is one case for each value of both, so that a curve goes through those of one colour."""
    if x.role != "parameter" or not is_grid(x.values, by.values) or len(levels(by.values)) > MOST_LEVELS:
        return False
    pairs = np.unique(np.stack([x.values, by.values]), axis=1).shape[1] if len(x.values) <= MANY else 0
    return pairs == len(x.values)


def _theirs(ax: Any, metric: MapMetric, x: CaseColumn, sets: list[Set], by: CaseColumn | None) -> None:
    """Draw the other archive's cases: hollow, under the own ones, with wide pale curves."""
    assert metric.theirs is not None
    y = np.where(np.isfinite(metric.theirs), metric.theirs, np.nan)
    drawn = _apart(x.values, y)
    size = 2.6 * MARKER / marker_scale(len(x.values)) ** 2
    for point_set in sets or [Set(drawn, FAINT, "", False)]:
        own = drawn[np.isin(drawn, point_set.places)]
        if point_set.joined:
            order = point_set.places[np.argsort(x.values[point_set.places])]
            ax.plot(
                x.values[order],
                y[order],
                color=point_set.colour,
                linewidth=1.0 + BEHIND,
                alpha=PALE,
                zorder=0.8,
                solid_capstyle="butt",
            )
        ax.scatter(
            x.values[own],
            y[own],
            s=size,
            facecolors="none",
            edgecolors=[point_set.colour],
            linewidths=0.7,
            zorder=0.9,
            rasterized=len(drawn) > RASTERED,
        )


def _reach(ax: Any, x: np.ndarray) -> None:
    """Extend the axis to all cases, including those whose marks stand on the panel's edges."""
    finite = levels(x)
    if len(finite):
        ax.update_datalim([(finite[0], 0.0), (finite[-1], 0.0)], updatey=False)
        ax.autoscale_view()


def _edge(ax: Any, values: np.ndarray, x: np.ndarray, size: float, *, hollow: bool = False) -> None:
    """Draw non-finite values at the edges of the panel: ▲ infinite, ▼ minus infinite, × no value. hollow: of another
    archive"""
    from matplotlib.transforms import ScaledTranslation

    size = max(12.0, size)
    style = {"facecolors": "none", "edgecolors": INK, "zorder": 3.9} if hollow else {"color": INK, "zorder": 4}
    for marked, marker, edge in (
        (np.isposinf(values), "^", 1.0),
        (np.isneginf(values), "v", 0.0),
        (np.isnan(values), "x", 1.0),
    ):
        where = x[marked & np.isfinite(x)]
        if len(where):
            where = where[_apart(where, np.zeros(len(where)))]
            tone = {"color": INK, "zorder": 3.9} if hollow and marker == "x" else style  # a cross has no face
            inside = (1.0 - 2.0 * edge) * (0.5 * size**0.5 + 1.0) / 72
            place = ax.get_xaxis_transform() + ScaledTranslation(0.0, inside, ax.figure.dpi_scale_trans)
            ax.scatter(
                where,
                np.full(len(where), edge),
                marker=marker,
                s=size,
                linewidths=0.8,
                transform=place,
                clip_on=False,
                **tone,
            )


def edge_words(values: np.ndarray) -> str:
    """The meaning of the marks on the edges, in words."""
    parts = []
    for marked, text in ((np.isinf(values), "infinite in {} (▲)"), (np.isnan(values), "no value in {} (×)")):
        if marked.any():
            parts.append(text.format(f"{int(marked.sum()):,}"))
    return ", ".join(parts)


def _limits(ax: Any, metric: MapMetric) -> None:
    """Draw lines at the limits that lie near enough to the points."""
    values = metric.values if metric.theirs is None else np.concatenate([metric.values, metric.theirs])
    finite = values[np.isfinite(values)]
    for limit in metric.column.limits:
        low, high = (finite.min(), finite.max()) if len(finite) else (limit.value, limit.value)
        if low == high or low - (high - low) <= limit.value <= high + (high - low):
            ax.axhline(limit.value, color=INK, linewidth=0.9, linestyle=(0, (1, 1.5)), label="limit", zorder=1.5)


def marker_scale(count: int) -> float:
    """The size of a marker among `count` markers, relative to a single one; the legend's are not smaller."""
    return 1.0 if count < 400 else 1.7 if count < 20_000 else 3.7


def _apart(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The places of the points to draw: among points on one dot of the picture only the last, which hides the
    others."""
    if len(x) <= MANY:
        return np.arange(len(x))
    drawable = np.flatnonzero(np.isfinite(y) & np.isfinite(x))[::-1]
    dots = np.zeros(len(drawable), np.int64)
    for values, count in ((x, DOTS[0]), (y, DOTS[1])):
        low, high = values[drawable].min(initial=np.inf), values[drawable].max(initial=-np.inf)
        dots = dots * (count + 1) + (count * (values[drawable] - low) / ((high - low) or 1.0)).astype(np.int64)
    return np.sort(drawable[np.unique(dots, return_index=True)[1]])


def legend_of(known: Mapping[str, Any], other: tuple[str, str] | None) -> dict[str, Any]:
    """Legend entries: the colours', then the limit, then which archive is which."""
    from matplotlib.lines import Line2D

    limit = {text: known[text] for text in ("limit",) if text in known}
    out = {text: handle for text, handle in known.items() if text != "limit"} | limit
    if other is None:
        return {} if list(out) == ["limit"] else out  # the panel's heading states the requirement
    dot: dict[str, Any] = {"linestyle": "", "marker": "o", "color": INK}
    return {
        **out,
        other[0]: Line2D([], [], markersize=3.5, markeredgewidth=0, **dot),
        other[1]: Line2D([], [], markersize=6, markerfacecolor="none", markeredgewidth=0.8, **dot),
    }


def bar(figure: Any, mapped: Any, axes: list[Any], by: CaseColumn, sheet: PictureSheet) -> None:
    """Draw the colour bar of a column by which points are coloured."""
    drawn = figure.colorbar(mapped, ax=axes, pad=0.01, aspect=18 * len(axes))
    if is_log(by):
        side = line(by)
        height = BAR * figure.get_figheight()
        write_log(drawn.ax.yaxis, replace(side, edges=levels(by.values)[[0, -1]]), height, sheet, upright=True)
    drawn.set_label(layout.with_unit(by.label, by.unit), fontsize=sheet.small)
    drawn.outline.set_visible(False)


def varied_axis(ax: Any, x: CaseColumn, sheet: PictureSheet) -> None:
    """Set up the axis of a varied parameter: a choice's words at their places, whole numbers of cases, orders of
    magnitude."""
    if is_log(x):
        side, wide = line(x), ax.figure.get_figwidth()
        ax.set_xscale("log")
        ax.set_xlim(side.edges[0], side.edges[-1])
        inches = wide - layout.BESIDE_ON_PAPER if sheet.narrow else PANEL * wide
        write_log(ax.xaxis, side, inches, sheet)
    if x.words:
        ax.set_xticks(range(len(x.words)), x.words)
        ax.set_xlim(-0.5, len(x.words) - 0.5)
    elif x.role in ("case", "repeat"):
        ax.xaxis.get_major_locator().set_params(integer=True)
