"""`met bed`: motor beds, real or emulated; faces of batch.beds and hw."""

from __future__ import annotations

import math
from typing import Any

import click

from batch.cli.quantities import SECONDS, QuantityOption, measured
from batch.cli.run import until_terminated
from met.cli import NO, YES, FiniteRange, check_options, deck_options, format_option, loudness_options
from met.diagnostic import Problem


class Amount(click.ParamType):
    """A quantity above zero with its unit: `12 V`; a bare number is SI."""

    name = "amount"

    def __init__(self, unit: str) -> None:
        self._unit = unit

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read an amount with its unit as SI."""
        try:
            amount = measured(value, self._unit)
        except (ValueError, Problem):
            amount = 0.0
        if not 0.0 < amount < math.inf:
            self.fail(f"`{value}` is none: write `12 {self._unit}`", param, ctx)
        return amount


EXCHANGES = QuantityOption(
    "rate",
    "Hz",
    "`1 kHz` or `500 Hz`",
    suits=lambda hz: 1.0 <= hz <= 1e5,
    beyond="to exchange at: 1 Hz to 100 kHz",
)
PORT = click.option("--port", "word", metavar="[JOINT=]PORT", required=True, help="The port of the bed.")
BAUD = click.option(
    "--baud",
    type=click.IntRange(1, 2**31 - 1),
    default=921600,
    show_default=True,
    metavar="BAUD",
    help="Baud rate of a serial line.",
)


class BedCommands(click.Group):
    """The group `met bed`, whose help lists the ports that there are drivers for, those of other packages too."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        from hw.drivers import kinds

        with formatter.section("Ports"):
            formatter.write_dl([(kind.written, kind.doc) for kind in kinds()])
        super().format_epilog(ctx, formatter)


@click.group(cls=BedCommands, short_help="Work with a motor bed: probe it, measure its line, run a deck's joint on it.")
def bed() -> None:
    """Work with a motor bed at one of the ports below: a real bed, a simulated one, or a transcript."""


@bed.command(short_help="Print which bed is at a port, and the readings of its sensors.")
@click.argument("source", metavar="[DECK|PLAN.json]", required=False)
@click.argument("names", nargs=-1, metavar="[NAME]")
@PORT
@BAUD
@deck_options
@format_option
@loudness_options
def probe(word: str, source: str | None, names: tuple[str, ...], **options: Any) -> int:
    """Connect to a bed and read its sensors: print its name, firmware, limits and scales, the faults that it has
    latched, and the rates for which the line is fast enough. The bed is not armed. A simulated bed, such as `emulated`,
    is that of DECK.

    Exit status: 0 the bed answers; 2 it does not, or the input is wrong.
    """
    from batch.beds.probe import probe_and_tell

    _check(source, names, options)
    probe_and_tell(word, source, names, **options)
    return YES


@bed.command(short_help="Clear the faults that a bed has latched.")
@PORT
@BAUD
@format_option
@loudness_options
def clear(word: str, **options: Any) -> int:
    """Clear the faults that a bed has latched. A bed that has stopped itself does not arm again before that. This
    command prints the faults, waits until the shaft is at rest, and clears them. Find the cause first.

    Exit status: 0 no fault is latched any more; 2 the bed does not answer, or its shaft does not stop.
    """
    from batch.beds.probe import clear_and_tell

    clear_and_tell(word, **options)
    return YES


@bed.command(short_help="Measure how punctual the exchanges with a bed are.")
@click.argument("source", metavar="[DECK|PLAN.json]", required=False)
@click.argument("names", nargs=-1, metavar="[NAME]")
@PORT
@BAUD
@click.option("--rate", type=EXCHANGES, metavar="RATE", help="Rate of the exchanges [that of the deck, else 1 kHz].")
@click.option(
    "--duration", type=SECONDS, metavar="TIME", default=10.0, show_default="10 s", help="Duration of the measurement."
)
@click.option(
    "--joints",
    type=click.IntRange(min=1, max=64),
    metavar="N",
    default=1,
    show_default=True,
    help="Exchanges in each period, one after another, as for this number of joints on beds.",
)
@deck_options
@format_option
@loudness_options
def jitter(word: str, source: str | None, names: tuple[str, ...], **options: Any) -> int:
    """Read a bed's sensors at a steady rate, as a run does, and print how late the exchanges began and how long they
    took. The bed is not armed. A shared computer may at other times be slower than in any measurement.

    Exit status: 0 a run would not have been stopped; 1 it would have been, by five periods of lateness or silence; 2
    the bed does not answer, or the input is wrong.
    """
    from batch.beds.jitter import jitter_and_tell

    _check(source, names, options)
    return YES if jitter_and_tell(word, source, names, **options) else NO


def _check(source: str | None, names: tuple[str, ...], options: dict[str, Any]) -> None:
    """Refuse options without effect, and more than one bed."""
    if len(names) > 1:
        raise click.UsageError(f"one bed at a time: `{names[0]}` or `{names[1]}`")
    if source is not None:
        check_options(source, names, False, options["defines"], options["include_dirs"], options["settings"])


@bed.command(short_help="Identify a bed's parameters from moves, and write them as a deck to include.")
@click.argument("source", metavar="DECK|PLAN.json")
@click.argument("names", nargs=-1, metavar="[NAME]")
@PORT
@BAUD
@click.option("--lock-step", is_flag=True, help="For simulated firmware: its time advances with the exchanges only.")
@click.option(
    "--kt-load",
    type=Amount("N*m/A"),
    metavar="CONSTANT",
    help="Torque constant of the load motor, by which torques are measured [that of the deck's bed].",
)
@click.option(
    "--kt-load-error",
    type=FiniteRange(0.0, 50.0),
    metavar="PERCENT",
    default=0.0,
    show_default=True,
    help="Half width of the 95 % interval of --kt-load; it widens the intervals of the results that depend on it.",
)
@click.option(
    "--voltage", type=Amount("V"), metavar="VOLTAGE", help="Largest voltage of the moves [the servo's v_max]."
)
@click.option(
    "--current",
    type=Amount("A"),
    metavar="CURRENT",
    help="Largest current of the moves [the one that balances the drive].",
)
@click.option(
    "--rate", type=Amount("rad/s"), metavar="RATE", help="Rate above which a move ends [0.8 of the bed's limit]."
)
@click.option("-o", "--output", metavar="FILE.ic", help="The deck to write [JOINT.identified.ic, in this folder].")
@deck_options
@format_option
@loudness_options
def identify(word: str, source: str, names: tuple[str, ...], **options: Any) -> int:
    """Move a bed for a minute, and estimate its resistance, torque constant, largest torque, friction and inertia, each
    with its 95 % interval. DECK has the values that are assumed before: the servo's motor is the data sheet.

    Only the load motor may be on the shaft, which turns in both directions at up to its full voltage. Exit status: 0
    the values were found; 2 the bed stopped, does not behave as its model, or the input is wrong.
    """
    from batch.beds.identifying import identify_and_tell

    _check(source, names, options)
    identify_and_tell(word, source, names, **options)
    return YES


@bed.command(short_help="Say what the two motors of a bed must provide, and which motors suffice.")
@click.argument("source", metavar="DECK|PLAN.json|ARCHIVE.h5")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option(
    "--joint", metavar="JOINT", help="The joint whose motor is on the bed [the one that is on a bed in the deck]."
)
@click.option(
    "--margin",
    type=FiniteRange(1.0, 100.0),
    metavar="FACTOR",
    default=1.5,
    show_default=True,
    help="Factor by which the motors should exceed what the cases need.",
)
@click.option("--drive", metavar="PART", help="A motor to check in the place of the joint's motor.")
@click.option("--load", metavar="PART", help="A motor to check as the load motor.")
@click.option(
    "--parts", metavar="FILE.toml", help="A file with motors of your own, in addition to those that come with MET."
)
@deck_options
@format_option
@loudness_options
def size(source: str, names: tuple[str, ...], **options: Any) -> int:
    """Run all cases of a deck's only run or sweep, of the one marked `default`, or of these NAMEs, and print what a bed
    for one of its joints must provide: torque, rate, power, current and voltage of both motors, what they feed back,
    the inertia that the load stands for, line and filter. Then say which motors suffice: those of --drive and --load,
    or all known ones. Of an archive, its cases are run again.

    Nothing is written. -v adds torque-speed curves. Exit status: 0 the motors that were named fit; 1 one of them does
    not, or this is not known; 2 the input is wrong.
    """
    from batch.beds.size import size_and_tell

    check_options(source, names, False, options["defines"], options["include_dirs"], options["settings"])
    return YES if size_and_tell(source, names, **options) else NO


@bed.command(short_help="Build the firmware of a bed's board, a file to drag onto it.")
@click.argument("bench", metavar="[BENCH.toml]", required=False)
@click.option("--board", type=click.Choice(["pico"]), required=True, help="The board: a Raspberry Pi Pico.")
@click.option("-o", "--output", metavar="FILE.uf2", help="The file to write [the bench's name, in this folder].")
@click.option("--show", is_flag=True, help="Print the bench's file instead, as a file to change.")
@loudness_options
def firmware(bench: str | None, board: str, output: str | None, show: bool, quiet: bool, verbose: bool) -> int:
    """Build the firmware of the bed in BENCH.toml, or of the one that the documentation wires, as a UF2 file. To load
    it, hold the board's button while you plug the board in, and drag the file onto the drive that appears. The same
    bench gives the same bytes.

    Exit status: 0 the file is written; 2 BENCH.toml is not a valid bench, or there is no compiler.
    """
    from batch.beds.flashing import firmware_and_tell

    if show and output is not None:
        raise click.UsageError("`--show` writes no file: leave `-o` out")
    firmware_and_tell(bench, output, show=show, quiet=quiet)
    return YES


@bed.command(short_help="Run a deck whose joints' motors are on beds.")
@click.argument("source", metavar="DECK|PLAN.json")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option(
    "--port",
    "ports",
    multiple=True,
    metavar="[JOINT=]PORT",
    required=True,
    help="The port of the bed; with several beds, the port of each.",
)
@BAUD
@click.option(
    "--lock-step",
    is_flag=True,
    help="For simulated firmware: its time advances with the exchanges only, so a run has the same bits each time.",
)
@click.option("--rest", type=SECONDS, metavar="TIME", help="Time for the motors to cool between cases (`30 s`).")
@click.option("--transcripts", metavar="DIR", help="Write all messages on the lines into files in this folder.")
@click.option(
    "--clear",
    is_flag=True,
    help="Before each case, clear the faults that its bed has latched: a sweep then goes on after a case whose bed "
    "stopped itself.",
)
@click.option("--force", is_flag=True, help="Arm the bed even if a law has no margin of stability.")
@click.option("-o", "--output", metavar="FILE", help="The archive to write [with the name that `met run` gives it].")
@click.option(
    "--case",
    "cases",
    multiple=True,
    metavar="ID",
    help="Only this case: the beginning of its id, or its position, as '#0'.",
)
@click.option("--fresh", is_flag=True, help="Start over, instead of running only what is missing.")
@click.option("--no-picture", is_flag=True, help="Draw no picture beside the archive.")
@deck_options
@loudness_options
def run(source: str, names: tuple[str, ...], **options: Any) -> int:
    """Run a deck's only run or sweep, the one marked `default`, or those of these NAMEs: the arm is simulated in real
    time, and the motor of each substituted joint is on its bed. Cases run one after another.

    The archive is like any other, and `met diff` compares it with that of a simulation. A case whose bed stops is a
    failed case, with the reason as its cause. Exit status: 0 all cases reached their end and met the requirements; 1
    not all did; 2 the input is wrong.
    """
    from batch.beds.running import run_and_tell

    check_options(source, names, False, options["defines"], options["include_dirs"], options["settings"])
    return until_terminated(run_and_tell, source, names, **options)
