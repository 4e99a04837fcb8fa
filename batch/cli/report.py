"""`met report`: face of batch.report."""

from __future__ import annotations

import click

from met.cli import YES, loudness_options
from met.host.streams import kept
from met.messages.visible import say


@click.command(short_help="Make one HTML page of an archive, to open anywhere and to send.")
@click.argument("archive", metavar="ARCHIVE")
@click.option("-o", "--output", metavar="FILE", help="The page to write [ARCHIVE.html].")
@click.option("--run", "experiments", multiple=True, metavar="NAME", help="Only this run or sweep of the archive.")
@click.option("--against", metavar="BEFORE.h5", help="An earlier archive: the page shows what has changed since.")
@click.option(
    "--tol",
    "tolerances",
    multiple=True,
    metavar="LIST",
    help="Differences from --against to accept, as for `met diff`: qd=1e-6rad/s,rel=1e-9,time=1ms; may be repeated.",
)
@click.option("--title", default="", metavar="TEXT", help="Title of the page [names of deck, runs and sweeps].")
@click.option(
    "--no-simulation",
    is_flag=True,
    help="Only the contents of the archive: the page runs no case again, and draws no arm.",
)
@click.option("--no-meshes", is_flag=True, help="Draw links by their shapes, without the files of their meshes.")
@loudness_options
def report(
    archive: str,
    output: str | None,
    experiments: tuple[str, ...],
    against: str | None,
    tolerances: tuple[str, ...],
    title: str,
    no_simulation: bool,
    no_meshes: bool,
    quiet: bool,
    verbose: bool,
) -> int:
    """Write the contents of an archive as one page: verdict, cases, worst cases, signals, and parameters with their
    origins.

    The page is a single file, opens without a network, and can be printed. Only a report of MET is overwritten. Exit
    status: 0 the page is written, whatever it says; 2 the input is wrong.
    """
    from batch.report import report as make
    from ic.printing.columns import size

    if tolerances and against is None:
        raise click.UsageError("--tol is for a comparison: `--against BEFORE.h5` names the other archive")
    notes: list[str] = []
    progress = (lambda done: click.echo(f"stability of {done} cases is known", err=True)) if verbose else None
    target = make(
        archive,
        output,
        experiments=experiments,
        title=title,
        against=against,
        tolerances=tolerances,
        simulate=not no_simulation,
        meshes=not no_meshes,
        tell=notes.append,
        progress=progress,
    )
    if not quiet:
        for note in notes:
            say(f"note: {note}", err=True)
        with kept(f"{target} is whole"):
            say(f"{target}  ({size(target.stat().st_size)})")
    return YES
