"""The command new, on top of `ic.beginnings`."""

from __future__ import annotations

import os
import shlex
import sys

import click

from ic.beginnings.models import MODELS
from met.cli import loudness_options
from met.host.streams import kept
from met.messages.visible import say

KINDS = ["deck", *MODELS]


@click.command()
@click.argument("kind", type=click.Choice(KINDS))
@click.argument("name")
@click.option("-o", "output", metavar="PATH", help="The deck's file, or the model's folder [named after NAME].")
@click.option("--force", is_flag=True, help="Overwrite existing files.")
@loudness_options
def new(kind: str, name: str, output: str | None, force: bool, quiet: bool, verbose: bool) -> None:
    """Write a deck or a model to begin from.

    It runs as it is; change what you need. `deck` is an arm of two links with servos, a run and a sweep. All others are
    models: a folder with the Python file, a deck to try it in, and the files that make it an installable package.
    """
    from ic.beginnings import files
    from ic.printing.columns import columns

    name = name.removesuffix(".ic")
    texts = files.new_deck(name, output) if kind == "deck" else files.model(kind, name, output)
    files.write(texts, force=force)
    if quiet:
        return
    with kept(f"{', '.join(texts)}: all is written"):
        for path in texts:
            say(f"wrote {path}")
        click.echo()
        for line in columns(_next(kind, name, list(texts))):
            click.echo(line)


def _next(kind: str, name: str, paths: list[str]) -> list[tuple[str, str]]:
    """The commands to type next, each with its effect."""
    deck = shlex.quote(next(path for path in paths if kind == "deck" or path.endswith(".ic")))
    run = (f"met run {deck}", "simulates it and shows what came of it")
    if kind == "deck":
        return [(f"met check {deck}", "says what is wrong with it, if anything is"), run]
    folder = os.path.join(".", os.path.dirname(paths[0])) if not os.path.isabs(paths[0]) else os.path.dirname(paths[0])
    install = f"{shlex.quote(sys.executable)} -m pip install -e {shlex.quote(folder)}"
    return [(install, "makes MET know it, once"), (f"met doc {kind} {name}", "what it declares"), run]
