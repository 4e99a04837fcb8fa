"""`met plot`: a face of batch.plotting."""

from __future__ import annotations

import click

from batch.cli.quantities import INSTANT
from met.cli import YES, loudness_options
from met.host.streams import kept
from met.messages.visible import say


@click.command(short_help="Draw signals, metrics and maps of an archive: PNG, SVG, PDF.")
@click.argument("archive", metavar="ARCHIVE")
@click.argument("names", nargs=-1, metavar="[SIGNAL|METRIC]...")
@click.option(
    "-o", "--output", metavar="FILE", help="The picture to write; its ending selects PNG, SVG or PDF [ARCHIVE.png]."
)
@click.option("--run", metavar="NAME", help="The run or sweep to draw [the first].")
@click.option(
    "--case",
    "cases",
    multiple=True,
    metavar="ID",
    help="Only this case: the beginning of its id, or its position, as '#0'; may be repeated.",
)
@click.option(
    "--over",
    metavar="A[,B[,C]]",
    default="",
    help="Parameters over which metrics are drawn: points over one, a map over two, a map for each value of a third.",
)
@click.option(
    "--against",
    metavar="OTHER.h5",
    help="Also draw the cases of another archive that have the same values; a map shows the difference.",
)
@click.option(
    "--size",
    default="",
    metavar="WIDTH[xHEIGHT]",
    help="Size for a paper: 8.5cm, or 8.5x6cm, with letters of 8 pt and no title.",
)
@click.option("--dpi", type=int, metavar="N", help="Dots per inch of a PNG [144; 300 with --size].")
@click.option("--arm", is_flag=True, help="Draw the arm at some instants, and the path of its tip.")
@click.option(
    "--at",
    multiple=True,
    type=INSTANT,
    metavar="TIME",
    help="With --arm: an instant, such as `2 s`; may be repeated.",
)
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
    arm: bool,
    at: tuple[float, ...],
    quiet: bool,
    verbose: bool,
) -> int:
    """Draw SIGNALs over time (`qd`, `elbow.q`), or METRICs over varied parameters (`settle`); by default all of them.

    Each signal has a panel, with joints as lines and cases overlaid, many of them as a fan. A metric is drawn with
    cases as points, or as a map if two parameters form a grid.
    """
    from batch.plotting import plot

    if arm:
        for option, value in (("names", names), ("--over", over), ("--against", against)):
            if value:
                raise click.UsageError(f"--arm draws an arm alone: leave out {option}")
        if len(cases) > 1:
            raise click.UsageError("--arm is of one case: leave all but one --case out")
    elif at:
        raise click.UsageError("--at is of --arm, which draws the arm at instants")
    parameters = [name.strip() for name in over.split(",") if name.strip()]
    drawn = {"run": run, "against": against}
    target = plot(archive, output, names, **drawn, cases=cases, over=parameters, size=size, dpi=dpi, arm=arm, at=at)
    if not quiet:
        with kept(f"{target} is whole"):
            say(f"{target}")
    return YES
