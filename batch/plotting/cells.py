"""The cells of a map, with their values, colours and marks.

Stripes and greys are drawn as stretches of a row, and signs so far apart that they are read, so that a map of many
cells is as clear, and nearly as fast, as one of few.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from batch.plotting.layout import INK, PictureSheet
from batch.plotting.measured import MapMetric
from batch.plotting.sides import MapSide
from batch.queries.grids import cell_cases
from met.frozen import frozen

INFINITE, FAILED, LACKING = "#c9ced3", "#828c95", "#e9ecee"
"""Greys of cells without a finite number, which differ from all colours of numbers."""

STRIPES, DOTTED = "/////", "....."
FINE = 60 * 60
"""Number of cells from which on they have no edges, and are drawn as an image within an SVG or a PDF."""

LEAST_SIGN, MOST_SIGN = 4.0, 5.0
"""Smallest and largest size of a sign in a cell, in points."""

SIGN_ROOM = 5.0
"""Distance between signs, relative to their size."""


@frozen
class CellValues:
    """The values of the cells, row by row from the lowest. occupied: True where a case is in the cell; failed: True
    where one failed."""

    values: np.ndarray
    occupied: np.ndarray
    failed: np.ndarray
    striped: tuple[tuple[np.ndarray, str], ...]


def cell_values(
    shown_values: np.ndarray,
    worse: str,
    metric: MapMetric,
    cells: np.ndarray,
    count: int,
    striped: list[tuple[np.ndarray, str]],
    *,
    differs: bool,
) -> CellValues:
    """The case that is shown in each cell. cells: the cell of each case, -1 for none; differs: True where changes are
    shown"""
    chosen = cell_cases(np.abs(shown_values) if differs else shown_values, cells, count, "<" if differs else worse)
    values = np.where(chosen >= 0, shown_values[chosen], np.nan)
    return CellValues(
        values,
        any_in(cells >= 0, cells, count),
        any_in(metric.failed, cells, count),
        tuple((any_in(marked, cells, count), hatch) for marked, hatch in striped),
    )


def any_in(cases: np.ndarray, cells: np.ndarray, count: int) -> np.ndarray:
    """True for each cell that holds some of these cases."""
    out = np.zeros(count, bool)
    out[cells[cases & (cells >= 0)]] = True
    return out


def draw(ax: Any, drawn: CellValues, x: MapSide, y: MapSide, colours: Any, norm: Any, sheet: PictureSheet) -> Any:
    """Draw colours, greys, stripes and signs. Returns the mappable for a colour bar."""
    shape = (len(y.levels.texts), len(x.levels.texts))
    values = drawn.values
    finite = np.isfinite(values)
    fine = len(values) > FINE
    plain = np.ma.masked_invalid(values).reshape(shape)
    edges = {} if fine else {"edgecolors": "face", "linewidth": 0.5}
    mapped = ax.pcolormesh(*np.meshgrid(x.edges, y.edges), plain, cmap=colours, norm=norm, rasterized=fine, **edges)
    infinite = np.isinf(values)
    failed = drawn.failed & np.isnan(values)
    lacking = drawn.occupied & np.isnan(values) & ~failed
    for which, grey in ((infinite, INFINITE), (failed, FAILED), (lacking, LACKING)):
        _fill(ax, x, y, which, facecolors=grey, edgecolors=grey, linewidth=0.5)
    light = np.ones(len(values), bool)
    light[finite] = _lightness(colours(norm(values[finite]))) > 0.5
    for wanted, hatch in drawn.striped:
        for tone, among in (("white", ~light), (INK, light)):
            _fill(ax, x, y, wanted & among, facecolors="none", edgecolors=tone, linewidth=0.0, hatch=hatch)
    size, room = _sign(ax, shape)
    for which, text in ((drawn.failed, "x"), (np.isposinf(values), "∞"), (np.isneginf(values), "−∞")):
        _signs(ax, x, y, which.reshape(shape), room, text, size)
    return mapped


def _fill(ax: Any, x: MapSide, y: MapSide, which: np.ndarray, **style: Any) -> None:
    """Rectangles over these cells, one for each stretch of neighbours in a row."""
    from matplotlib.collections import PolyCollection

    if not which.any():
        return
    corners = _corners(x, y, which.reshape(len(y.levels.texts), len(x.levels.texts)))
    ax.add_collection(PolyCollection(list(corners), rasterized=which.size > FINE, **style), autolim=False)


def _corners(x: MapSide, y: MapSide, rows: np.ndarray) -> np.ndarray:
    """The corners of the stretches of neighbouring cells in each row, [stretch, corner, 2]."""
    steps = np.diff(np.pad(rows, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    up, first = np.nonzero(steps > 0)
    end = np.nonzero(steps < 0)[1]
    left, right, low, high = x.edges[first], x.edges[end], y.edges[up], y.edges[up + 1]
    return np.stack(
        [np.stack([left, low], 1), np.stack([right, low], 1), np.stack([right, high], 1), np.stack([left, high], 1)],
        axis=1,
    )


def _lightness(colours: np.ndarray) -> np.ndarray:
    """Luma of RGBA colours, 0 to 1 (ITU-R BT.601)."""
    return np.asarray(colours[:, :3] @ np.array([0.299, 0.587, 0.114]))


def _sign(ax: Any, shape: tuple[int, int]) -> tuple[float, tuple[int, int]]:
    """The size of a sign, in points, and how many rows and columns of cells it needs for itself."""
    width, height = ax.figure.get_size_inches() * 72
    columns, rows = ax.get_gridspec().ncols, ax.get_gridspec().nrows
    cell = (0.6 * height / rows / shape[0], 0.6 * width / columns / shape[1])
    size = float(np.clip(0.5 * min(cell), LEAST_SIGN, MOST_SIGN))
    return size, (max(1, round(SIGN_ROOM * size / cell[0])), max(1, round(SIGN_ROOM * size / cell[1])))


def _spaced(which: np.ndarray, room: tuple[int, int]) -> np.ndarray:
    """Thin these cells to one in each block of `room` rows and columns: the one nearest to its middle."""
    if room == (1, 1) or not which.any():
        return which
    up, across = np.nonzero(which)
    blocks = (up // room[0]) * (which.shape[1] // room[1] + 1) + across // room[1]
    far = np.hypot(up % room[0] - (room[0] - 1) / 2, across % room[1] - (room[1] - 1) / 2)
    order = np.lexsort((far, blocks))
    nearest = order[np.unique(blocks[order], return_index=True)[1]]
    out = np.zeros(which.shape, bool)
    out[up[nearest], across[nearest]] = True
    return out


def _signs(ax: Any, x: MapSide, y: MapSide, which: np.ndarray, room: tuple[int, int], text: str, size: float) -> None:
    """Signs over some of these cells. The outline of an infinity sign covers no other cell, and a sign in a stretch
    narrower than itself stands in the stretch's middle, whole also at the map's edge."""
    if not which.any():
        return
    up, across = np.nonzero(_spaced(which, room))
    centres = _in_stretch(x, which, room[1])[up, across], y.centres[up]
    if text == "x":
        ax.scatter(*centres, s=size**2, marker="x", linewidths=0.8, color=INK, zorder=3, clip_on=False)
        return
    from matplotlib.path import Path

    style: dict[str, Any] = {"s": 4.0 * len(text) ** 2 * size**2, "marker": infinity(text)}
    around = ax.scatter(*centres, facecolors=INFINITE, edgecolors=INFINITE, linewidths=2.5, zorder=2.9, **style)
    around.set_clip_path(Path.make_compound_path_from_polys(_corners(x, y, which)), ax.transData)
    ax.scatter(*centres, color=INK, linewidths=0.0, zorder=3, clip_on=False, **style)


def _in_stretch(x: MapSide, which: np.ndarray, most: int) -> np.ndarray:
    """The position of a sign over each cell: in the middle of its stretch of neighbours, if at most `most`."""
    place = np.arange(which.shape[1])
    beside = np.pad(which, ((0, 0), (1, 1)))
    first = np.maximum.accumulate(np.where(which & ~beside[:, :-2], place, 0), axis=1)
    end = np.minimum.accumulate(np.where(which & ~beside[:, 2:], place + 1, len(place))[:, ::-1], axis=1)[:, ::-1]
    few = end - first <= most
    left, right = x.edges[np.where(few, first, place)], x.edges[np.where(few, end, place + 1)]
    return np.asarray(np.sqrt(left * right) if x.scale == "log" else (left + right) / 2)


def infinity(text: str = "∞") -> Any:
    """The marker of an infinite value."""
    from matplotlib.textpath import TextPath
    from matplotlib.transforms import Affine2D

    drawn = TextPath((0, 0), text, size=1)
    box = drawn.get_extents()
    return drawn.transformed(Affine2D().translate(-(box.x0 + box.x1) / 2, -(box.y0 + box.y1) / 2))
