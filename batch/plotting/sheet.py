"""The size and style of a picture: for a screen, or for the column of a paper."""

from __future__ import annotations

import re
from typing import Any

from met.diagnostic import Problem, error
from met.frozen import frozen

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of Okabe and Ito, "Color Universal Design" (2008), which colour-blind eyes can distinguish too."""

INK, FAINT, LIGHT = "#22282e", "#8a939c", "#e4e7ea"

STYLE: dict[str, Any] = {
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
    def style(self) -> dict[str, Any]:
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
