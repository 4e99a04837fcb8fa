"""Arrangement of panels, their texts, legends and the title."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any, TypeVar

import numpy as np

from batch.archive.read import ArchiveFile
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.messages.visible import visible

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of Okabe and Ito, "Color Universal Design" (2008), which colour-blind eyes can distinguish too."""

INK, FAINT, LIGHT = "#22282e", "#8a939c", "#e4e7ea"

STYLE: Any = {
    "font.family": "DejaVu Sans",
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "grid.color": LIGHT,
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "hatch.linewidth": 0.6,
    "text.parse_math": False,  # names of files may have dollars
    "figure.facecolor": "white",
    "agg.path.chunksize": 20000,
    "svg.fonttype": "path",  # the same wherever it is opened, whatever fonts are installed
    "svg.hashsalt": "met",
    "pdf.fonttype": 42,  # whole fonts, as journals require
}

SCREEN_DPI, PAPER_DPI = 144, 300
LEAST_CM, MOST_CM = 4.0, 120.0
LEAST_DPI, MOST_DPI = 30, 2400
NARROW = 5.0
"""Width in inches below which legends stand under the panels."""

INCHES = {"cm": 1 / 2.54, "mm": 1 / 25.4, "in": 1.0}
_SIZE = re.compile(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(?:[x×]\s*(\d+(?:\.\d*)?|\.\d+)\s*)?(cm|mm|in)\s*")


@frozen
class PictureSheet:
    """The sheet that a picture is drawn on. width, height: inches; None: as the panels need it."""

    width: float | None = None
    height: float | None = None
    dpi: int | None = None

    @property
    def paper(self) -> bool:
        """True if the picture is for a paper, whose caption describes it."""
        return self.width is not None

    @property
    def narrow(self) -> bool:
        return self.width is not None and self.width < NARROW

    @property
    def small(self) -> float:
        """Points of letters in titles and legends; labels of axes have `normal`."""
        return 8.0 if self.paper else 8.5

    @property
    def normal(self) -> float:
        return 8.0 if self.paper else 9.0

    @property
    def resolution(self) -> int:
        return self.dpi or (PAPER_DPI if self.paper else SCREEN_DPI)

    @property
    def style(self) -> Any:
        """The settings of matplotlib for this sheet."""
        thin = {"lines.linewidth": 1.1, "axes.linewidth": 0.6, "grid.linewidth": 0.5} if self.paper else {}
        dots = {"figure.dpi": self.resolution, "savefig.dpi": self.resolution}
        return {**STYLE, "font.size": self.normal, **thin, **dots}


def sheet(size: str = "", dpi: int | None = None) -> PictureSheet:
    """A sheet of `8.5cm` wide, or of `8.5x6cm`. Raises Problem E392."""
    if dpi is not None and not LEAST_DPI <= dpi <= MOST_DPI:
        message = f"{dpi} dots per inch: they are from {LEAST_DPI} to {MOST_DPI}"
        raise Problem(error("E392", message, help="`--dpi 600`"))
    if not size:
        return PictureSheet(dpi=dpi)
    match_ = _SIZE.fullmatch(size)
    helps = "as `--size 8.5cm`, a column's width, or `--size 8.5x6cm`; in cm, mm or in"
    if match_ is None:
        raise Problem(error("E392", f"size `{size}` cannot be read", help=helps))
    width, height, unit = match_.groups()
    sides = [float(side) * INCHES[unit] for side in (width, height) if side is not None]
    if not all(LEAST_CM <= side / INCHES["cm"] <= MOST_CM for side in sides):
        message = f"size `{size}`: sides are from {LEAST_CM:g} cm to {MOST_CM:g} cm"
        raise Problem(error("E392", message, help=helps))
    return PictureSheet(sides[0], sides[1] if len(sides) > 1 else None, dpi)


def sequence(index: int, count: int) -> Any:
    """Colours for ordered cases: from dark blue to yellow, without the pale end."""
    import matplotlib

    return matplotlib.colormaps["viridis"](0.0 if count == 1 else 0.88 * index / (count - 1))


T = TypeVar("T")

PANEL_INCHES, TALL_INCHES = 1.85, (4.2, 2.9)
FLAT = 0.3
"""Height of a row of zeros, relative to the others."""

WIDE, TALL = (1.1, 0.4, 1.5), (1.3, 0.62, 2.6)
"""On paper: the smallest ratio of a panel's height to its width, and its smallest and largest height, inches."""

LETTER = 0.56
"""Mean width of a letter of DejaVu Sans, relative to its size."""

BESIDE, BESIDE_ON_PAPER = 1.0, 0.75
"""Width in inches beside a panel for its numbers and label."""

LINE = 1.45
"""Distance of two lines of text, in sizes of the letters."""

TICK_INCHES = 0.5
"""Width on paper of a number below a panel, with room around it, inches."""


def figure(
    sheet: PictureSheet, columns: int, heights: Sequence[float], *, tall: bool = False, share_y: bool = False
) -> tuple[Any, list[list[Any]]]:
    """A figure and its axes, row by row, which share what is below. heights: of the rows, against one another; tall:
    panels are nearly as high as they are wide."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    if sheet.paper:
        engine = ConstrainedLayoutEngine(h_pad=0.04, w_pad=0.03, hspace=0.02)
        width = sheet.width or 0.0
        least, slope, most = TALL if tall else WIDE
        panel = min(most, max(least, slope * width / columns))
        height = sheet.height or panel * max(sum(heights), 1.0) + 0.5
    else:
        engine = ConstrainedLayoutEngine(h_pad=0.05, w_pad=0.06, hspace=0.02)
        width = TALL_INCHES[0] * columns + 1.6 if tall else 8.6 if columns == 1 else 3.6 * columns + 2.2
        panel = TALL_INCHES[1] if tall else PANEL_INCHES
        height = panel * max(sum(heights), 1.0 if tall else 1.5) + 1.0
    picture = Figure(figsize=(width, height), layout=engine)
    axes = picture.subplots(
        len(heights), columns, sharex=True, sharey=share_y, squeeze=False, height_ratios=list(heights)
    )
    if sheet.paper:  # its own choice of ticks expects shorter numbers
        axes[0][0].locator_params(axis="x", nbins=max(2, int((width / columns - BESIDE_ON_PAPER) / TICK_INCHES)))
    return picture, [list(row) for row in axes]


DRAWABLE = 1e300
"""The largest number that is drawn; larger ones count as infinite, since the span of an axis would overflow."""

MOST_PANELS = 40
"""Largest number of stacked panels."""


def drawable(values: np.ndarray) -> np.ndarray:
    """The values, with infinity for those outside of any axis."""
    return np.where(np.abs(values) > DRAWABLE, np.copysign(np.inf, values), values)


def as_many_as_fit(panels: Sequence[T], named: bool, what: str) -> tuple[Sequence[T], str]:
    """The panels that fit into a picture, and a remark on the others. named: True where they were named. Raises Problem
    E391."""
    if len(panels) <= MOST_PANELS:
        return panels, ""
    if named:
        message = f"{len(panels):,} {what} in one picture: {MOST_PANELS} at most"
        raise Problem(error("E391", message, help="draw several pictures, each with a name of its own: `-o FILE.png`"))
    return panels[:MOST_PANELS], f"{MOST_PANELS} of {len(panels):,} {what}, others by name"


def letters(sheet: PictureSheet, inches: float) -> int:
    """The number of small letters that fit into a width."""
    return max(12, int(inches * 72 / (LETTER * sheet.small)))


def head(ax: Any, text: str, sheet: PictureSheet, columns: int, colour: str = INK) -> None:
    """Write a panel's heading, in as many lines as its width requires."""
    wide = letters(sheet, ax.figure.get_figwidth() / columns - (BESIDE_ON_PAPER if sheet.paper else BESIDE))
    parts = text.split(" · ") if len(text) > wide else [text]
    lines = [line for part in parts for line in textwrap.wrap(part, wide)]
    if ax.get_subplotspec().colspan.start == 0:
        _grow(ax.figure, sheet, len(lines) - 1)
    ax.set_title("\n".join(lines), loc="left", fontsize=sheet.small, color=colour, pad=3 if sheet.paper else 4)


def _grow(figure: Any, sheet: PictureSheet, lines: float) -> None:
    """Enlarge a picture on paper by further lines, unless its height is given."""
    if sheet.paper and sheet.height is None:
        figure.set_figheight(figure.get_figheight() + lines * LINE * sheet.small / 72)


def with_unit(label: str, unit: str) -> str:
    """The label of an axis: `settle  (s)`."""
    return f"{label}  ({unit})" if unit else label


def two_lines(label: str, most: int = 16) -> str:
    """A long label in two lines: name, unit."""
    return label.replace("  (", "\n(") if len(label) > most else label


def legend(
    figure: Any, handles: Mapping[str, Any], sheet: PictureSheet, title: str | None = None, *, below: bool = False
) -> None:
    """One for the whole picture, handles by their texts: right of the panels; under them on a narrow sheet, and where
    that is asked for."""
    if not handles:
        return
    style: dict[str, Any] = {"fontsize": sheet.small, "alignment": "left", "title_fontsize": sheet.small}
    if sheet.narrow or below:
        longest = max(len(text) for text in handles)
        columns = max(1, int(figure.get_figwidth() * 72 / ((longest * LETTER + 4.0) * sheet.small)))
        columns = min(columns, len(handles))
        title = textwrap.fill(title.replace("\n", " "), letters(sheet, figure.get_figwidth() - 0.2)) if title else None
        _grow(figure, sheet, -(-len(handles) // columns) + (title.count("\n") + 1 if title else 0) + 0.5)
        style |= {"loc": "outside lower left", "ncols": columns, "columnspacing": 1.2}
        style |= {"handlelength": 1.6, "borderaxespad": 0.2}
    else:
        style |= {"loc": "outside right upper"}
    figure.legend(handles.values(), handles.keys(), title=title, **style)


def legend_label(text: str) -> str | None:
    """The text of a line in a legend: matplotlib leaves out texts that begin with `_`, and does not draw a thin
    space."""
    return f"\N{THIN SPACE}{text}" if text.startswith("_") else text or None


def legend_entries(axes: Sequence[Sequence[Any]]) -> dict[str, Any]:
    """The handle of each label in these panels, each text once."""
    known: dict[str, Any] = {}
    for ax in (ax for row in axes for ax in row):
        handles, labels = ax.get_legend_handles_labels()
        known |= {text: handle for text, handle in zip(labels, handles, strict=True) if text not in known}
    return known


def title(figure: Any, archive: ArchiveFile, name: str, below: str, sheet: PictureSheet) -> None:
    """Write the title: on a screen deck and run, and `below` the contents; on paper only the latter."""
    if sheet.paper:
        if below:
            text = textwrap.fill(below, letters(sheet, figure.get_figwidth() - 0.1))
            _grow(figure, sheet, text.count("\n") + 1)
            figure.suptitle(text, x=0.012, ha="left", fontsize=sheet.small, color=INK)
        return
    line = visible(f"{PurePath(archive.deck.strip('<>')).name} · {name}")
    lines = textwrap.wrap(below, letters(sheet, figure.get_figwidth() - 0.3))
    spare = "\n" * len(lines)
    figure.suptitle(f"{line}{spare}", x=0.012, ha="left", fontsize=12, fontweight="bold", linespacing=1.5)
    for number, title_line in enumerate(lines):
        height = 1.0 - (0.42 + 0.2 * number) / figure.get_figheight()
        figure.text(0.012, height, title_line, fontsize=sheet.small, color=FAINT, ha="left", va="center")
