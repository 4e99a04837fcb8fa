"""`met run`, `submit`, `status`: faces of batch.terminal.running, .submitting and .status."""

from __future__ import annotations

import glob
from collections.abc import Callable
from typing import Any

import click

from batch.cli.quantities import SECONDS
from batch.formats import endings
from met.cli import NO, YES, check_options, deck_options, format_option, loudness_options
from met.messages.visible import line, say

MOST_NAMED = 5
"""Largest number of archives that are named where the given name is unknown."""

ROWS = click.option(
    "--rows",
    default="all",
    metavar="WHICH",
    help="Cases that have a row in the archive: all; or those few that a `summary` of all cases names; or "
    "worst:N:METRIC, the N worst in addition. [all]",
)

VERIFY = click.option(
    "--verify",
    type=click.Choice(["auto", "none", "some", "all"]),
    default="auto",
    metavar="WHICH",
    help="Cases to run again with half and a quarter of the step, to estimate the errors of metrics: none, some, "
    "all, or auto, which is some if that is cheap. [auto]",
)


@click.command(short_help="Run the cases of a deck or a plan into an archive.")
@click.argument("source", metavar="DECK|PLAN.json|ARCHIVE.h5")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--all", "everything", is_flag=True, help="All runs and sweeps of the deck, or all cases of the archive.")
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    help="The archive to write [in this folder: DECK.h5 for what DECK runs without a NAME, else DECK.NAME.h5]; "
    f"FILE{endings(' or ')}: FILE.h5, and an export of it.",
)
@click.option(
    "--case",
    "cases",
    multiple=True,
    metavar="ID",
    help="Only this case: the beginning of its id, or its position, as '#0'.",
)
@click.option("--failed", is_flag=True, help="Of an archive: run again the cases that did not reach their end.")
@click.option(
    "--histories",
    multiple=True,
    metavar="WHICH",
    help="Cases whose signals are kept: all, none, every:N, failed, worst:N:METRIC, or a case; may be combined. "
    "Metrics are always kept. [all, while the archive stays below 1 GiB]",
)
@click.option("--float32", is_flag=True, help="Keep signals as 32-bit numbers.")
@click.option("--threads", type=click.IntRange(min=1), metavar="N", help="Threads of each process [one per core].")
@click.option(
    "--processes",
    type=click.IntRange(min=1),
    metavar="N",
    help="Run in N processes: a case that kills its process is identified, and all others are completed.",
)
@click.option(
    "--dask", metavar="ADDRESS", help="Run on the workers of the Dask scheduler at this address, or of a `local` one."
)
@click.option(
    "--timeout",
    type=SECONDS,
    metavar="TIME",
    help="Give up a case that makes no progress for this time (`90 s`, `5 min`); cases then run in processes.",
)
@click.option(
    "--max-failures", type=click.IntRange(min=0), metavar="N", help="Stop when more than N cases have failed."
)
@click.option("--fresh", is_flag=True, help="Start over, instead of running only what is missing.")
@VERIFY
@ROWS
@click.option("--no-picture", is_flag=True, help="Draw no picture beside the archive.")
@deck_options
@format_option
@loudness_options
def run(source: str, names: tuple[str, ...], form: str, **options: Any) -> int:
    """Run a deck's only run or sweep, else the one marked `default`; or those of these NAMEs.

    The archive opens directly in xarray, and a picture is drawn beside it. A run that was interrupted or killed is
    resumed. Of an archive, cases are run again, to the same bits. Exit status: 0 all cases reached their end and met
    the requirements; 1 not all did; 2 the input is wrong, and nothing was written.
    """
    from batch.terminal.running import run_and_tell

    check_options(
        source, names, options["everything"], options["defines"], options["include_dirs"], options["settings"]
    )
    return until_terminated(run_and_tell, source, names, json=form == "json", **options)


def until_terminated(run_and_tell: Callable[..., bool], *arguments: Any, **options: Any) -> int:
    """Run cases until they are done or a signal terminates the command; returns the exit status."""
    from batch.executors.termination import TERMINATED, Terminated, terminable

    try:
        with terminable():
            return YES if run_and_tell(*arguments, **options) else NO
    except Terminated:
        click.echo("\nmet: terminated", err=True)
        return TERMINATED


@click.command(short_help="Submit the cases of a deck or a plan to a cluster's queue.")
@click.argument("source", metavar="DECK|PLAN.json")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option(
    "--slurm",
    is_flag=True,
    required=True,
    help="Submit to SLURM, by sbatch: a job array, and a job that merges the results.",
)
@click.option("--jobs", type=click.IntRange(min=1), metavar="N", help="Number of jobs in the array [16].")
@click.option(
    "--sbatch",
    "options",
    multiple=True,
    metavar="WORD",
    help="Another option for sbatch, such as --partition=long; may be repeated.",
)
@click.option("--all", "everything", is_flag=True, help="All runs and sweeps of the deck.")
@click.option("-o", "--output", metavar="FILE", help="The archive to write [with the name that `met run` gives it].")
@click.option(
    "--case",
    "cases",
    multiple=True,
    metavar="ID",
    help="Only this case: the beginning of its id, or its position, as '#0'.",
)
@click.option("--histories", multiple=True, metavar="WHICH", help="Cases whose signals are kept, as for `met run`.")
@click.option("--float32", is_flag=True, help="Keep signals as 32-bit numbers.")
@click.option("--timeout", type=SECONDS, metavar="TIME", help="Give up a case that makes no progress for this time.")
@click.option("--fresh", is_flag=True, help="Start over, instead of submitting only what is missing.")
@VERIFY
@ROWS
@deck_options
@format_option
@loudness_options
def submit(source: str, names: tuple[str, ...], slurm: bool, form: str, **options: Any) -> int:
    """Submit the missing cases of a campaign as a job array. This folder must be on a file system that all nodes see.

    The archive is complete when the last job has ended; `met status ARCHIVE` shows the progress. The same command
    submits again what a cancelled job has not done, or `met run` runs it here.
    """
    from batch.terminal.running import submit_and_tell

    check_options(
        source, names, options["everything"], options["defines"], options["include_dirs"], options["settings"]
    )
    submit_and_tell(source, names, json=form == "json", **options)
    return YES


@click.command(short_help="Show the progress of a campaign that runs, waits or was interrupted.")
@click.argument("where", metavar="ARCHIVE|FOLDER")
@format_option
def status(where: str, form: str) -> int:
    """Show the progress of a campaign, from any shell. ARCHIVE is the archive that it will write, or its folder
    ARCHIVE.campaign.

    Exit status: 0 the campaign is complete; 1 not yet; 2 there is no such campaign.
    """
    import json
    import time
    from pathlib import Path

    from batch.campaigns.status import find_folder, finished_archive, lines, report, unfinished_in
    from met.diagnostic import Problem, error
    from met.outputs import quoted

    folder = find_folder(where)
    if folder is None:
        if (data := finished_archive(Path(where.removesuffix(".campaign")))) is None:
            others = unfinished_in(Path(where).parent)
            helps = ["campaigns here: " + ", ".join(others)] if others else []
            archives = sorted(path.name for path in Path(where).parent.glob(f"{glob.escape(Path(where).stem)}*.h5"))
            if archives and not where.endswith(".h5"):
                helps.append("a status is of an archive; here: " + ", ".join(map(quoted, archives[:MOST_NAMED])))
            helps.append("`met run DECK -o ARCHIVE` begins one; its folder is beside the archive until that is whole")
            raise Problem(error("E359", f"no campaign fills {where}", help=helps))
        since = f", begun at {data['began']}" if data["began"] != "unknown" else ""
        text = f"{data['archive']} is whole: {data['cases']:,} case{'s' if data['cases'] != 1 else ''}{since}"
        say(json.dumps(data, indent=1) if form == "json" else line(text))
        return YES
    data = report(folder, time.time())
    say(json.dumps(data, indent=1) if form == "json" else "\n".join(map(line, lines(data))))
    return NO  # its folder exists, so its archive is not whole, whatever is done
