"""`met bed`: motor beds, real or emulated; faces of batch.beds and hw."""

from __future__ import annotations

from typing import Any

import click

from batch.cli_run import SECONDS
from met.cli import NO, YES, check_options, deck_options, loudness_options


@click.group(short_help="Drive a motor bed: probe it, run a deck's joint on it.")
def bed() -> None:
    """Work with a motor bed, at PORT: a serial line (/dev/ttyUSB0, socket://HOST:PORT), `emulated` (the deck's bed in
    this process), `firmware` or `qemu` (the bed's firmware over a simulated plant, here or on an emulated Cortex-M3),
    or the transcript of an earlier run.
    """


@bed.command(short_help="Run a deck whose joints' motors are on beds.")
@click.argument("source", metavar="DECK|PLAN.json")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--port", "ports", multiple=True, metavar="[JOINT=]PORT", required=True, help="Where the bed is; of "
              "several beds each.")  # fmt: skip
@click.option("--baud", type=click.IntRange(min=1), default=921600, show_default=True, help="Of a serial line.")
@click.option("--lock-step", is_flag=True, help="Of simulated firmware: it has no time of its own, so "
              "that a run has the same bits each time.")  # fmt: skip
@click.option("--rest", type=SECONDS, metavar="TIME", help="Let the motors cool between cases (`30 s`).")
@click.option("--transcripts", metavar="DIR", help="Write what goes over the lines into files in this folder.")
@click.option("--force", is_flag=True, help="Arm the bed also where a law has no margin of stability.")
@click.option("-o", "--output", metavar="FILE", help="The archive [as `met run` calls it].")
@click.option("--case", "cases", multiple=True, metavar="ID", help="Only this case: the beginning of its id, or '#0'.")
@click.option("--fresh", is_flag=True, help="Start over, rather than drive what is missing.")
@click.option("--no-picture", is_flag=True, help="Draw no picture beside the archive.")
@deck_options
@loudness_options
def run(source: str, names: tuple[str, ...], **options: Any) -> int:
    """Run a deck's only run or sweep, the one marked `default`, or those of these NAMEs: the arm is simulated in real
    time, and the motor of each substituted joint is on its bed. Cases follow one another.

    The archive is like any other: `met diff` compares it with the simulation's. A case whose bed stops is a failed
    case, and says why. Exit status: 0 all cases reached their end and met the requirements; 1 not all; 2 the input is
    wrong.
    """
    from batch.beds.running import run_and_tell
    from batch.termination import TERMINATED, Terminated, terminable

    check_options(source, names, False, options["defines"], options["include_dirs"], options["settings"])
    try:
        with terminable():
            return YES if run_and_tell(source, names, **options) else NO
    except Terminated:
        click.echo("\nmet: terminated", err=True)
        return TERMINATED
