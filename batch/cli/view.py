"""`met view`: a face of batch.portable and batch.watching."""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path

import click

from met.cli import YES, check_options, confess, deck_options, loudness_options
from met.host.sources import names_archive, names_plan
from met.host.streams import kept
from met.messages.visible import say


@click.command(short_help="Make a page that runs an archive's cases again with sliders, or watch a deck on one.")
@click.argument("source", metavar="ARCHIVE|DECK")
@click.argument("name", metavar="[NAME]", required=False)
@click.option("-o", "--output", metavar="FILE", help="Of an archive: the page to write [ARCHIVE.view.html].")
@click.option(
    "--against",
    metavar="FILE",
    help="Of an archive: another archive, or a log as a CSV file, whose arm and signals are shown beside it.",
)
@click.option(
    "--numbers",
    metavar="DECK",
    help="Of an archive: also show its deck, whose numbers can then be dragged; this takes a second module.",
)
@click.option(
    "--port", type=click.IntRange(1, 65535), metavar="N", help="Of a deck: the port on 127.0.0.1 [a free one]."
)
@click.option("--no-meshes", is_flag=True, help="Draw links by their shapes, without the files of their meshes.")
@deck_options
@loudness_options
def view(
    source: str,
    name: str | None,
    output: str | None,
    against: str | None,
    numbers: str | None,
    port: int | None,
    no_meshes: bool,
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    quiet: bool,
    verbose: bool,
) -> int:
    """Write an archive's only run or sweep, or NAME, as a page with a slider for each varied number. Or watch a deck:
    the page of its run, or of NAME, is renewed each time the deck is saved.

    When a slider is moved, the page itself computes the run, with the bits of the archive; where the archive has the
    case, the page compares. The page is a single file and opens without a network.

    The page of a deck is served on 127.0.0.1, to those who have the printed address, until Ctrl-C or until the terminal
    is closed. A mistake in the deck is shown beside the last run without one. A file that is not a deck, and a NAME
    that the deck does not have, are refused (exit status 2).
    """
    of_archive = () if numbers is not None else include_dirs
    check_options(source, () if name is None else (name,), False, defines, of_archive, settings)
    if names_plan(source):
        raise click.UsageError(f"`{source}` is a plan: `met run {source}` runs it, and `met view` takes the archive")
    if names_archive(source):
        if port is not None:
            raise click.UsageError(f"--port is for decks: the page of the archive `{source}` is a file")
        return _write(source, name, output, against, numbers, include_dirs, quiet, meshes=not no_meshes)
    for option, given, why in (
        ("-o", output is not None, f"the page of the deck `{source}` is served; `met run` makes an archive of it"),
        ("--against", against is not None, f"`met run {source}` makes one of the deck"),
        ("--numbers", numbers is not None, f"`met run {source}` makes one of the deck"),
        ("--no-meshes", no_meshes, "the page of a deck has a switch for meshes"),
    ):
        if given:
            raise click.UsageError(f"{option} is for archives: {why}")
    return _watch(source, name, port or 0, defines, include_dirs, settings, quiet=quiet, verbose=verbose)


def _write(
    archive: str,
    name: str | None,
    output: str | None,
    against: str | None,
    numbers: str | None,
    include_dirs: tuple[str, ...],
    quiet: bool,
    *,
    meshes: bool,
) -> int:
    """Write the page of an archive, and say where it is; returns the exit status. output: None: beside the archive."""
    from batch.portable import files
    from batch.portable.page import view as page
    from ic.printing.columns import size
    from met.outputs import path_of, quoted

    target = Path(archive).with_suffix(".view.html") if output is None else path_of(output)
    files.check_page(target)
    notes: list[str] = []
    text = page(archive, () if name is None else (name,), against, numbers, include_dirs, notes.append, meshes=meshes)
    files.write_page(text, target)
    if not quiet:
        for note in notes:
            say(f"note: {note}", err=True)
        with kept(f"{target} is whole"):
            say(f"{target}  ({size(target.stat().st_size)})")
            say(
                f"One file, to open in a browser or to send. All cases at once: `met report {quoted(archive)}`",
                err=True,
            )
    return YES


def _watch(
    deck: str,
    name: str | None,
    port: int,
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    *,
    quiet: bool,
    verbose: bool,
) -> int:
    """Show a deck's run on a page that follows each save of the deck, until the command is ended; returns the exit
    status."""
    from batch.executors.termination import TERMINATED, Terminated, terminable
    from batch.watching.answers import WatchedDeck
    from batch.watching.following import follow
    from ic.find import find

    def ready(address: str) -> None:
        say(address)
        if not quiet:
            end = "Ctrl-C ends it" if sys.stdin is not None and sys.stdin.isatty() else f"`kill {os.getpid()}` ends it"
            say(f"The page of {deck}, for a browser on this machine. Who has the address can read it. {end}.", err=True)

    def tell(messages: str) -> None:
        if not quiet:
            say(messages, err=True)

    words = ["view", deck, *([] if name is None else [name])]
    confess_here = partial(confess, arguments=words, verbose=verbose)
    path = find(deck, include_dirs)
    try:
        with terminable():
            watched = WatchedDeck(deck, path, include_dirs, defines, settings)
            follow(watched, name, port=port, ready=ready, tell=tell, confess=confess_here)
    except Terminated:
        return TERMINATED
    except KeyboardInterrupt:
        return YES
    return YES
