"""The command import, on top of `ic.driver.import_robot`."""

from __future__ import annotations

import os

import click

from met.cli import loudness_options
from met.diagnostic import Problem, error
from met.host.streams import kept
from met.messages.visible import say


@click.command("import", short_help="Make a deck from a robot's URDF or MJCF file.")
@click.argument("file")
@click.option("-o", "output", metavar="DECK", help="Write the deck to this file, instead of printing it.")
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@click.option(
    "--mimic",
    type=click.Choice(["follow", "free", "fixed"]),
    default="follow",
    help="Joints that follow other joints in the file: let them `follow`, as they do without this option, make them "
    "`free` to move, or `fixed` where those put them at the start.",
)
@loudness_options
def import_(file: str, output: str | None, force: bool, mimic: str, quiet: bool, verbose: bool) -> None:
    """Make a deck from a URDF file, or a model in MuJoCo's MJCF: the arm with its limits, friction as comments, and
    runs to begin with.

    `met import panda.urdf -o panda.ic`, then `met run panda.ic`. A deck can also take a URDF file as it is:
    `arm panda from urdf("panda.urdf") { ... }`. For MJCF, MuJoCo is needed: `pip install 'met-arm[mjcf]'`.
    """
    from ic.beginnings.files import put
    from ic.driver.import_robot import import_with_remarks

    if force and output is None:
        raise click.UsageError("--force is for -o: nothing is written without it")
    text, remarks = import_with_remarks(file, mimic, output)  # type: ignore[arg-type]  # click has seen to it
    if output is None:
        say(text, end="", exact=True)
        _remark(remarks, quiet)
        return
    if not output or os.path.isdir(output):
        raise Problem(error("D216", f"`{output}` is no name of a file", help="name the deck: `-o arm.ic`"))
    if os.path.exists(output) and os.path.samefile(output, file):
        raise Problem(error("D216", f"`{output}` is the file that is read", help="-o names another"))
    if os.path.lexists(output) and not force:
        raise Problem(error("D216", f"`{output}` is there already", help="--force writes over it, -o names another"))
    put(output, text)
    if not quiet:
        with kept(f"{output} is whole"):
            say(f"wrote {output}")
    _remark(remarks, quiet)


def _remark(remarks: list[str], quiet: bool) -> None:
    for remark in [] if quiet else remarks:
        say(f"note: {remark}", err=True)
