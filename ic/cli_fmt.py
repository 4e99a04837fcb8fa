"""The command fmt, on top of `ic.formatting`."""

from __future__ import annotations

import click

from met.cli import BAD_INPUT, NO, YES, complain, loudness_options
from met.diagnostic import Problem
from met.messages.visible import say


@click.command()
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@click.option("--check", is_flag=True, help="Write nothing; exit with 1 if a deck would change.")
@click.option("--diff", is_flag=True, help="Write nothing; print what would change.")
@click.option(
    "--upgrade", is_flag=True, help="Convert the decks to edition 2; it is proved first that they keep their meaning."
)
@loudness_options
def fmt(paths: tuple[str, ...], check: bool, diff: bool, upgrade: bool, quiet: bool, verbose: bool) -> int:
    """Format decks: indentation, blanks, alignment.

    PATH is a deck, a folder (all `.ic` files in it and in its folders), or `-`: from standard input to standard output.
    Line breaks, and the choice of what is aligned, are yours; tokens, comments and preprocessor lines stay as they are.
    A deck with a syntax error is not changed. --upgrade writes the line `deck 2;`, and brackets where the editions read
    a text differently; all runs and sweeps keep their plans and keys, or else the file is not changed. Exit status: 0
    done, or nothing to do; 1 with --check: some decks would change; 2 a deck cannot be formatted or upgraded.
    """
    from ic.driver.upgrade import Upgrades, upgrades
    from ic.formatting.files import STDIN, decks, lay_out, write

    files = decks(paths)
    if STDIN in files and len(files) > 1:
        raise click.UsageError("`-` stands alone: what is formatted goes to standard output")
    upgraded = Upgrades({}, {})
    if upgrade:
        if STDIN in files:
            raise click.UsageError("--upgrade takes files: what a deck means depends on what lies beside it")
        upgraded = upgrades([path for path in files if not path.endswith(".json")])
    changed = 0
    broken = False
    for path in files:
        try:
            if path in upgraded.refused:
                raise upgraded.refused[path]
            deck = lay_out(path, upgraded.texts.get(path))
            if deck.changes and path != STDIN and not (check or diff):
                write(path, deck.after)
        except Problem as problem:
            complain(problem.diagnostics, problem.sources)
            broken = True
            continue
        changed += deck.changes
        if diff:
            say("".join(deck.diff()), end="", exact=True)
        if path == STDIN and not (check or diff):
            say(deck.after, end="", exact=True)
        if path != STDIN and not quiet and (verbose or deck.changes) and (check or not diff):
            done = "upgraded" if path in upgraded.texts else "formatted"
            state = "as it should be" if not deck.changes else f"would be {done}" if check else done
            ends = "; its lines end with a newline alone" if deck.changes and deck.ends else ""
            say(f"{deck.name}: {state}{ends}", err=diff)
    if broken:
        return BAD_INPUT
    return NO if check and changed else YES
