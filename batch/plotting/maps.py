"""Metrics over two parameters: a map of cells where cases fill a grid, else a point a case; beside one another for the
values of a third parameter.

A colour says what a metric is, rising in lightness, so that it reads in grey; stripes, which cases miss what is
required; grey, that there is no number. Against another archive: own less theirs, in colours that part at zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.grids import FULL, cells_of, levelled, standing
from batch.plotting import layout, sides
from batch.plotting.measured import Measured
from batch.plotting.points import RASTERED
from batch.plotting.sheet import FAINT, INK, Sheet
from batch.plotting.sides import Side
from batch.pool import Column
from met.distinct import distinct
from met.frozen import frozen

RISING, PARTING = "viridis", "RdBu_r"
GREY = "#c9ced3"
STRAY = 5.0
"""Colours go to the extremes unless these lie so many times further apart than nine in ten of the values."""

STRIPES, DOTTED = "/////", "....."
RINGS = {STRIPES: "o", DOTTED: "s"}
"""What is around a point in their stead."""

WIDEST = 2.6
"""Inches of a map on paper: where there is more room, maps stand beside one another."""


@frozen
class Plan:
    """What is drawn over what: x and y of all maps, of which each holds some of the cases; names of the archives."""

    x: Side
    y: Side
    cells: np.ndarray
    filled: bool
    several: int
    other: tuple[str, str] | None

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.y.levels.texts), len(self.x.levels.texts)


def plan(x: Column, y: Column, third: Column | None, other: tuple[str, str] | None) -> Plan:
    """Sides and cells. Cases fill the grid if most of its cells hold one; else they are points, by their values."""
    if x.role == "choice" and y.role != "choice":
        x, y = y, x
    across, up = sides.side(x), sides.side(y)
    cells = cells_of(across.levels, up.levels)
    there = cells[cells >= 0]
    filled = len(distinct(there)) > FULL * len(across.levels.texts) * len(up.levels.texts)
    apart = there if third is None else there * 1000 + levelled(third.values).places[cells >= 0]
    several = int(np.unique(apart, return_counts=True)[1].max(initial=0))
    if not filled:
        across, up = sides.line(x), sides.line(y)
    return Plan(across, up, cells, filled, several, other)


def draw(sheet: Sheet, found: Plan, metrics: Sequence[Measured], third: Column | None) -> tuple[Any, list[list[Any]]]:
    """The figure and its axes; what is written above it is left to the caller."""
    if third is None:
        wide = int(sheet.width / WIDEST) if sheet.width else 2 if len(metrics) < 5 else 3
        columns = max(1, min(len(metrics), wide))
        rows = -(-len(metrics) // columns)
        figure, axes = layout.figure(sheet, columns, [1.0] * rows, tall=True, share_y=True)
        every = np.ones(len(found.cells), bool)
        flat = [ax for row in axes for ax in row]
        for ax in flat[len(metrics) :]:
            ax.set_visible(False)
        for ax, each in zip(flat, metrics, strict=False):
            layout.head(ax, _about(each, found), sheet, columns)
            _bar(figure, _map(ax, each, found, every, _norm(each, found)), [ax], each, found, sheet)
    else:
        named = sides.side(third).levels
        columns = len(named.texts)
        figure, axes = layout.figure(sheet, columns, [1.0] * len(metrics), tall=True, share_y=True)
        for row, each in zip(axes, metrics, strict=True):
            norm, mapped = _norm(each, found), None
            for index, ax in enumerate(row):
                mapped = _map(ax, each, found, named.places == index, norm)
                if row is axes[0]:
                    value = f"{named.texts[index]} {third.unit}".rstrip()
                    text = value if third.words else f"{third.label} = {value}"
                    layout.head(ax, text, sheet, columns)
            _bar(figure, mapped, row, each, found, sheet)
    _sides(axes, found, sheet)
    layout.legend(figure, _marks(metrics, found), sheet, below=True)
    return figure, axes


def said(found: Plan, metrics: Sequence[Measured], third: Column | None) -> str:
    """What a cell or a point is, and beside a third parameter what is required."""
    if not found.filled:
        text = "a point a case"
    elif found.several == 1:
        text = "a cell a case"
    else:
        text = f"up to {found.several:,} cases in a cell, which shows {_stands(metrics, found)}"
    required = [each.about.rpartition(" · ")[2] for each in metrics if each.column.limits and found.other is None]
    return "; ".join([text, *(required if third is not None else [])])


def _stands(metrics: Sequence[Measured], found: Plan) -> str:
    if found.other is not None:
        return "the one that differs most"
    judged = {bool(each.column.limits) for each in metrics}
    worst, middle = "the worst by what is required", "the middle one"
    return worst if judged == {True} else middle if judged == {False} else f"{worst}, or {middle} where nothing is"


def _about(each: Measured, found: Plan) -> str:
    return each.column.about or each.column.label if found.other is not None else each.about


# Colours


def _shown(each: Measured, found: Plan) -> np.ndarray:
    return each.values if found.other is None else each.difference


def _norm(each: Measured, found: Plan) -> tuple[Any, str]:
    """What has which colour, and at which ends values go beyond."""
    from matplotlib.colors import Normalize

    shown = _shown(each, found)
    finite = shown[np.isfinite(shown)]
    if not len(finite):
        return Normalize(0.0, 1.0), "neither"
    low, five, ninety_five, high = np.percentile(finite, (0, 5, 95, 100)).tolist()
    if found.other is not None:
        far, usual = max(-low, high), max(-five, ninety_five)
        top = usual if far > STRAY * usual > 0.0 else far or 1.0
        ends = (low < -top, high > top)
        return Normalize(-top, top), _ends(*ends)
    usual = ninety_five - five
    if high - low > STRAY * usual > 0.0:
        bottom, top = max(low, five - usual), min(high, ninety_five + usual)
        return Normalize(bottom, top), _ends(low < bottom, high > top)
    if low == high:
        return Normalize(low - abs(low or 1.0) * 0.05, high + abs(high or 1.0) * 0.05), "neither"
    return Normalize(low, high), "neither"


def _ends(low: bool, high: bool) -> str:
    return "both" if low and high else "min" if low else "max" if high else "neither"


def _colours(found: Plan) -> Any:
    import matplotlib

    return matplotlib.colormaps[RISING if found.other is None else PARTING]


def _bar(figure: Any, mapped: Any, axes: Sequence[Any], each: Measured, found: Plan, sheet: Sheet) -> None:
    shown = _shown(each, found)
    if not np.isfinite(shown).any():
        return
    bar = figure.colorbar(mapped, ax=list(axes), pad=0.02, aspect=16, extend=mapped.extend)
    label = each.label
    if found.other is not None:
        unit = f"  ({each.column.unit})" if each.column.unit else ""
        label = f"{each.column.label}: {found.other[0]} − {found.other[1]}{unit}"
    bar.set_label(layout.broken(label, 26), fontsize=sheet.small)
    bar.outline.set_visible(False)
    if found.other is None:
        for limit in each.column.limits:
            if mapped.norm.vmin < limit.value < mapped.norm.vmax:
                bar.ax.axhline(limit.value, color="white", linewidth=2.4)
                bar.ax.axhline(limit.value, color=INK, linewidth=1.0)


# One map


def _map(ax: Any, each: Measured, found: Plan, here: np.ndarray, norm: tuple[Any, str]) -> Any:
    """Cells or points of one metric, of some of the cases. Gives what the colour bar is of."""
    ax.grid(False)
    if found.other is not None:  # where white is no change
        ax.set_facecolor(GREY)
    for name, one in (("x", found.x), ("y", found.y)):
        if one.scale == "log":
            getattr(ax, f"set_{name}scale")("log")
        getattr(ax, f"set_{name}lim")(one.edges[0], one.edges[-1])
    mapped = (_cells if found.filled else _points)(ax, each, found, here, norm[0])
    mapped.extend = norm[1]
    return mapped


def _cells(ax: Any, each: Measured, found: Plan, here: np.ndarray, norm: Any) -> Any:
    from matplotlib.patheffects import withStroke

    rows, columns = found.shape
    count = rows * columns
    cells = np.where(here, found.cells, -1)
    shown = _shown(each, found)
    ranked, worse = (shown, each.worse) if found.other is None else (np.abs(shown), "<")
    chosen = standing(ranked, cells, count, worse)
    values = np.where(chosen >= 0, shown[chosen], np.nan)
    there = _any(cells >= 0, cells, count)
    x, y = np.meshgrid(found.x.edges, found.y.edges)
    finite = np.isfinite(values)
    plain = np.ma.masked_invalid(values).reshape(found.shape)
    colours = _colours(found)
    mapped = ax.pcolormesh(x, y, plain, cmap=colours, norm=norm, edgecolors="face", linewidth=0.5)
    _fill(ax, found, there & ~finite, facecolors=GREY, edgecolors=GREY, linewidth=0.5)
    light = np.zeros(count, bool)
    light[finite] = _lightness(colours(norm(values[finite]))) > 0.5
    light |= ~finite
    for marked, hatch in _striped(each, found):
        wanted = _any(marked, cells, count)
        for tone, among in (("white", ~light), (INK, light)):
            _fill(ax, found, wanted & among, facecolors="none", edgecolors=tone, linewidth=0.0, hatch=hatch)
    size = _glyph(ax, found)
    centre_x, centre_y = (each_axis.ravel() for each_axis in np.meshgrid(found.x.centres, found.y.centres))
    failed = _any(each.failed, cells, count)
    if failed.any():
        ax.scatter(centre_x[failed], centre_y[failed], s=size, marker="x", color=INK, linewidths=0.8, zorder=3)
    for infinite, text in ((np.isposinf(values), "∞"), (np.isneginf(values), "−∞")):
        if infinite.any():
            ax.scatter(centre_x[infinite], centre_y[infinite], s=4.0 * len(text) ** 2 * size, marker=_infinity(text),
                       color=INK, linewidths=0.0, zorder=3,
                       path_effects=[withStroke(linewidth=2.5, foreground=GREY)])  # fmt: skip
    return mapped


def _any(cases: np.ndarray, cells: np.ndarray, count: int) -> np.ndarray:
    """Which cells hold some of these cases."""
    out = np.zeros(count, bool)
    out[cells[cases & (cells >= 0)]] = True
    return out


def _fill(ax: Any, found: Plan, which: np.ndarray, **style: Any) -> None:
    from matplotlib.collections import PolyCollection

    if not which.any():
        return
    up, across = np.divmod(np.flatnonzero(which), found.shape[1])
    left, right = found.x.edges[across], found.x.edges[across + 1]
    low, high = found.y.edges[up], found.y.edges[up + 1]
    corners = np.stack([np.stack([left, low], 1), np.stack([right, low], 1), np.stack([right, high], 1),
                        np.stack([left, high], 1)], axis=1)  # fmt: skip
    ax.add_collection(PolyCollection(list(corners), **style), autolim=False)


def _lightness(colours: np.ndarray) -> np.ndarray:
    """Luma of RGBA colours, 0 to 1 (ITU-R BT.601)."""
    return np.asarray(colours[:, :3] @ np.array([0.299, 0.587, 0.114]))


def _glyph(ax: Any, found: Plan) -> float:
    """Area of a mark in a cell, in square points."""
    width, height = ax.figure.get_size_inches() * 72
    columns, rows = ax.get_gridspec().ncols, ax.get_gridspec().nrows
    cell = min(0.6 * width / columns / found.shape[1], 0.6 * height / rows / found.shape[0])
    return float(np.clip(0.5 * cell, 1.2, 5.0) ** 2)


def _infinity(text: str = "∞") -> Any:
    """A marker."""
    from matplotlib.textpath import TextPath
    from matplotlib.transforms import Affine2D

    drawn = TextPath((0, 0), text, size=1)
    box = drawn.get_extents()
    return drawn.transformed(Affine2D().translate(-(box.x0 + box.x1) / 2, -(box.y0 + box.y1) / 2))


def _striped(each: Measured, found: Plan) -> list[tuple[np.ndarray, str]]:
    if found.other is None or each.theirs_missed is None:
        return [(each.missed, STRIPES)]
    both = each.both
    return [(both & each.missed & ~each.theirs_missed, STRIPES), (both & ~each.missed & each.theirs_missed, DOTTED)]


def _points(ax: Any, each: Measured, found: Plan, here: np.ndarray, norm: Any) -> Any:
    shown = _shown(each, found)
    x, y = found.x.of_cases(), found.y.of_cases()
    finite = here & np.isfinite(shown)
    size = 22.0 if here.sum() < 400 else 8.0
    style: dict[str, Any] = {"s": size, "rasterized": int(here.sum()) > RASTERED}
    mapped = ax.scatter(x[finite], y[finite], c=shown[finite], cmap=_colours(found), norm=norm, linewidths=0, **style)
    for marked, hatch in _striped(each, found):
        rings = finite & marked
        ax.scatter(x[rings], y[rings], marker=RINGS[hatch], facecolors="none", edgecolors=INK, linewidths=0.8, **style)
    for marked, marker in ((here & np.isnan(shown), "x"), (here & np.isposinf(shown), _infinity()),
                           (here & np.isneginf(shown), _infinity("−∞"))):  # fmt: skip
        if marked.any():
            ax.scatter(x[marked], y[marked], marker=marker, color=FAINT, linewidths=0.8, **style)
    return mapped


# What is written


def _sides(axes: Sequence[Sequence[Any]], found: Plan, sheet: Sheet) -> None:
    """Values and names of the parameters, on the left and below all."""
    width, height = axes[0][0].figure.get_size_inches()
    across = max(0.6, width / len(axes[0]) - (0.9 if sheet.paper else 1.5))
    up = max(0.5, height / len(axes) - 0.6)
    sides.write(axes[0][0].xaxis, found.x, across, sheet, upright=False, cells=found.filled)
    sides.write(axes[0][0].yaxis, found.y, up, sheet, upright=True, cells=found.filled)
    for number, row in enumerate(axes):
        for column, ax in enumerate(row):
            last = all(not later[column].get_visible() for later in axes[number + 1 :])
            ax.set_xlabel(found.x.label if last else "")
            ax.tick_params(labelbottom=last, labelleft=column == 0, top=False, right=False)
            ax.set_ylabel(layout.broken(found.y.label, 22) if column == 0 else "")


def _marks(metrics: Sequence[Measured], found: Plan) -> dict[str, Any]:
    """What stripes, grey and signs stand for, of those that are there."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    out: dict[str, Any] = {}

    def patch(hatch: str) -> Any:
        return Patch(facecolor="none", edgecolor=INK, linewidth=0.0, hatch=hatch)

    def dot(marker: Any, **style: Any) -> Any:
        return Line2D([], [], linestyle="", marker=marker, color=INK, **style)

    stripes = [marked for each in metrics for marked in _striped(each, found)]
    texts = ["misses what is required"] if found.other is None else [f"missed in {name} alone" for name in found.other]
    for hatch, text in zip((STRIPES, DOTTED), texts, strict=False):
        if any(marked.any() for marked, which in stripes if which == hatch):
            out[text] = patch(hatch) if found.filled else dot(RINGS[hatch], markerfacecolor="none", markersize=5)
    shown = [_shown(each, found) for each in metrics]
    if any(np.isinf(each).any() for each in shown):
        down = not any(np.isposinf(each).any() for each in shown)
        out["infinite"] = dot(_infinity("−∞" if down else "∞"), markersize=9, markeredgewidth=0.0)
    if any(each.failed.any() for each in metrics):
        out["failed"] = dot("x", markersize=4.5)
    both = metrics[0].both if metrics else True
    empty = len(distinct(found.cells[both & (found.cells >= 0)])) < np.prod(found.shape)
    if found.filled and any(_lacking(values, each) for values, each in zip(shown, metrics, strict=True)):
        out["no value"] = Patch(facecolor=GREY)
    if found.filled and empty:
        tone = "white" if found.other is None else GREY
        out["no case" if found.other is None else "not in both"] = Patch(facecolor=tone, edgecolor=FAINT, linewidth=0.6)
    return out


def _lacking(shown: np.ndarray, each: Measured) -> bool:
    """Whether a case that is there and did not fail has no value."""
    return bool(np.isnan(shown[each.both & ~each.failed]).any())
