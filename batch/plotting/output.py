"""The output of a picture: PNG, SVG or PDF by the name's ending, written whole, with existing files protected."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from met.diagnostic import Problem, error
from met.host.files import open_regular, whole_file
from met.messages.visible import visible
from met.outputs import check_ending, check_overwrite, check_place, writing

SOFTWARE = "MET"
MOST_DOTS = 200_000_000
"""Largest number of dots of a PNG: each takes four bytes while it is drawn."""

HEAD_BYTES, TAIL_BYTES = 2000, 20_000

# By ending: metadata about the program, without a date, and its bytes in the file.
METADATA: dict[str, dict[str, str | None]] = {
    ".png": {"Software": SOFTWARE},
    ".svg": {"Creator": SOFTWARE, "Date": None},
    ".pdf": {"Creator": SOFTWARE, "CreationDate": None},
}
MARKS = {
    ".png": b"\0\0\0\x0ctEXtSoftware\0" + SOFTWARE.encode(),  # with its length, since other texts may begin so
    ".svg": f"<dc:title>{SOFTWARE}</dc:title>".encode(),
    ".pdf": f"/Creator ({SOFTWARE})".encode(),
}


def check(output: Path) -> None:
    """Refuse to overwrite a file that is not a picture of MET's. Raises Problem E305; E326 for another ending."""
    with writing(output, code="E305"):
        check_ending(output, tuple(METADATA), code="E326", kinds="pictures are PNG, SVG or PDF files")
        check_place(output, code="E305", inside=output / "plot.png")
        check_overwrite(output, own, code="E305", because=" and was not drawn by MET")


def own(output: Path) -> bool:
    """True if a picture says that MET drew it."""
    with open_regular(output) as file:
        text = file.read(HEAD_BYTES)
        file.seek(max(len(text), output.stat().st_size - TAIL_BYTES))
        return MARKS[output.suffix.lower()] in text + file.read()


def save(figure: Any, output: Path) -> None:
    """The picture under its name when it is whole; the same figure gives the same bytes. Raises Problem E305, and E392
    where the panels have no room."""
    import importlib
    import warnings

    from matplotlib.text import Text

    for text in figure.findobj(Text):  # names and units in an archive may hold any characters
        text.set_text(visible(text.get_text()))
    kind = output.suffix.lower()
    _check_dots(figure, kind)
    backend, canvas = {
        ".png": ("agg", "FigureCanvasAgg"),
        ".svg": ("svg", "FigureCanvasSVG"),
        ".pdf": ("pdf", "FigureCanvasPdf"),
    }[kind]
    drawn = getattr(importlib.import_module(f"matplotlib.backends.backend_{backend}"), canvas)(figure)
    try:
        with writing(output, code="E305"), whole_file(output) as file, warnings.catch_warnings():
            warnings.filterwarnings("error", message="constrained_layout not applied")
            warnings.filterwarnings("ignore", message="Glyph .* missing from font")
            getattr(drawn, f"print_{kind[1:]}")(file, metadata=METADATA[kind])
    except UserWarning as reason:
        wide, high = (f"{2.54 * side:.3g}" for side in figure.get_size_inches())
        message = f"{wide} x {high} cm have no room for {len(figure.axes)} panels, with what is written on them"
        helps = ("a larger `--size`, or its width alone: the height is then what is needed", "name fewer to draw")
        raise Problem(error("E392", message, help=helps)) from reason


def _check_dots(figure: Any, kind: str) -> None:
    """Refuse a PNG that would take gigabytes to draw. Raises Problem E392."""
    across, up = (round(side * figure.dpi) for side in figure.get_size_inches())
    if kind == ".png" and across * up > MOST_DOTS:
        message = f"{across:,} x {up:,} dots: a PNG has {MOST_DOTS:,} at most"
        raise Problem(error("E392", message, help=("a smaller `--dpi` or `--size`", "an SVG or a PDF has no dots")))
