"""`met plot`: a face of batch.plotting."""

from __future__ import annotations

import click

from met.cli import YES, loudness_options
from met.messages.visible import say


@click.command(short_help="Draw signals, metrics and maps of an archive: PNG, SVG, PDF.")
@click.argument("archive", metavar="ARCHIVE")
@click.argument("names", nargs=-1, metavar="[SIGNAL|METRIC]...")
@click.option("-o", "--output", metavar="FILE", help="The picture; its ending says PNG, SVG or PDF [ARCHIVE.png].")
@click.option("--run", metavar="NAME", help="The run or sweep to draw [the first].")
@click.option(
    "--case",
    "cases",
    multiple=True,
    metavar="ID",
    help="Only this case: the beginning of its id, or '#0'; may be repeated.",
)
@click.option(
    "--over",
    metavar="A[,B[,C]]",
    default="",
    help="What metrics are drawn over: points over one parameter, a map over two, one for each value of a third.",
)
@click.option(
    "--against",
    metavar="OTHER.h5",
    help="Another archive's cases of the same values under these; in a map the difference.",
)
@click.option(
    "--size",
    default="",
    metavar="WIDTH[xHEIGHT]",
    help="For a paper: 8.5cm, or 8.5x6cm, with letters of 8 pt and no title.",
)
@click.option("--dpi", type=int, metavar="N", help="Dots of a PNG to the inch [144; with --size 300].")
@loudness_options
def plot(
    archive: str,
    names: tuple[str, ...],
    output: str | None,
    run: str | None,
    cases: tuple[str, ...],
    over: str,
    against: str | None,
    size: str,
    dpi: int | None,
    quiet: bool,
    verbose: bool,
) -> int:
    """Draw SIGNALs over time (`qd`, `elbow.q`) or METRICs over what is varied (`settle`); all where none is named.

    Signals: a panel each, joints as lines, cases overlaid, many of them as a fan. Metrics: cases as points, or as a map
    where two parameters make a grid.
    """
    from batch.plotting import plot

    parameters = [name.strip() for name in over.split(",") if name.strip()]
    target = plot(archive, output, names, run=run, cases=cases, over=parameters, against=against, size=size, dpi=dpi)
    if not quiet:
        say(f"{target}")
    return YES
