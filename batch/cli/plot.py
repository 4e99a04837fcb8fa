"""`met plot`: a face of batch.plotting."""

from __future__ import annotations

import click

from batch.cli.instant import Instant
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
@click.option("--arm", is_flag=True, help="The arm itself, at some instants, and the path of its tip.")
@click.option(
    "--at", multiple=True, type=Instant(), metavar="TIME", help="With --arm: an instant, `2 s`; may be repeated."
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
    """Draw SIGNALs over time (`qd`, `elbow.q`) or METRICs over what is varied (`settle`); all where none is named.

    Signals: a panel each, joints as lines, cases overlaid, many of them as a fan. Metrics: cases as points, or as a map
    where two parameters make a grid.
    """
    from batch.plotting import plot

    if arm:
        for option, given in (("names", names), ("--over", over), ("--against", against)):
            if given:
                raise click.UsageError(f"--arm draws an arm alone: leave out {option}")
        if len(cases) > 1:
            raise click.UsageError("--arm is of one case: leave all but one --case out")
    elif at:
        raise click.UsageError("--at is of --arm, which draws the arm at instants")
    parameters = [name.strip() for name in over.split(",") if name.strip()]
    drawn = {"run": run, "against": against}
    target = plot(archive, output, names, **drawn, cases=cases, over=parameters, size=size, dpi=dpi, arm=arm, at=at)
    if not quiet:
        say(f"{target}")
    return YES
