"""`met report`: face of batch.report."""

from __future__ import annotations

import click

from met.cli import YES, loudness_options
from met.messages.visible import say


@click.command(short_help="Make one HTML page of an archive, to open anywhere and to send.")
@click.argument("archive", metavar="ARCHIVE")
@click.option("-o", "--output", metavar="FILE", help="The page [ARCHIVE.html].")
@click.option("--run", "experiments", multiple=True, metavar="NAME", help="Only this run or sweep of the archive.")
@click.option("--against", metavar="BEFORE.h5", help="An earlier archive: the page says what changed since.")
@click.option(
    "--tol",
    "tolerances",
    multiple=True,
    metavar="LIST",
    help="How much may differ from it, as `met diff` has it: qd=1e-6rad/s,rel=1e-9,time=1ms; may be repeated.",
)
@click.option("--title", default="", metavar="TEXT", help="What stands above it [names of deck, runs and sweeps].")
@click.option(
    "--no-simulation", is_flag=True, help="Only what the archive has: the page runs no case again, and draws no arm."
)
@loudness_options
def report(
    archive: str,
    output: str | None,
    experiments: tuple[str, ...],
    against: str | None,
    tolerances: tuple[str, ...],
    title: str,
    no_simulation: bool,
    quiet: bool,
    verbose: bool,
) -> int:
    """Write what an archive holds as one page: verdict, cases, worst cases, signals, parameters and where they come
    from.

    The page is whole in one file, opens without a network, and prints. Nothing is written over but a report of MET.
    Exit status: 0 it is written, whatever it says; 2 the input is wrong.
    """
    from batch.report import report as make
    from ic.printing.columns import size

    if tolerances and against is None:
        raise click.UsageError("--tol is for a comparison: `--against BEFORE.h5` names the other archive")
    told = (lambda done: click.echo(f"stability of {done} cases is known", err=True)) if verbose else None
    target = make(
        archive,
        output,
        experiments=experiments,
        title=title,
        against=against,
        tolerances=tolerances,
        simulate=not no_simulation,
        progress=told,
    )
    if not quiet:
        say(f"{target}  ({size(target.stat().st_size)})")
    return YES
