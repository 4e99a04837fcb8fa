"""`met lsp`: the face of ic.editor, the language server."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from ic.editor.lenses import LastRun

from met.diagnostic import Problem, error


@click.command(short_help="Serve an editor: messages as you type, completion, meanings of words.")
@click.option(
    "-I",
    "include_dirs",
    multiple=True,
    metavar="DIR",
    type=click.Path(exists=True, file_okay=False),
    help="Also look for included files here; may be repeated.",
)
@click.option(
    "-D", "defines", multiple=True, metavar="NAME[=VALUE]", help="Define a macro, as #define does; may be repeated."
)
@click.option(
    "--stdio", is_flag=True, help="Standard input and output, as editors ask for them; there is no other way."
)
def lsp(include_dirs: tuple[str, ...], defines: tuple[str, ...], stdio: bool) -> None:
    """Serve an editor by the Language Server Protocol, on standard input and output.

    The editor starts this command; docs/editors.md has settings for Neovim, Helix, Emacs and VS Code. The command needs
    the package pygls, which MET's extra `editor` installs.
    """
    from importlib.util import find_spec

    if find_spec("pygls") is None:
        install = f"`{shlex.quote(sys.executable)} -m pip install pygls` brings it to the Python that runs MET"
        message = "`met lsp` speaks to editors by pygls, which is not here"
        raise Problem(error("E345", message, help=(install, "MET's extra `editor` names it")))
    from ic.editor.server import serve

    serve(include_dirs, defines, _last_runs)


def _last_runs(deck: str) -> Mapping[str, LastRun]:
    """The last run of each run and sweep of a deck, from the archives beside it."""
    from batch.queries.last_run import last_runs  # an archive's reader is loaded where a lens is asked for

    return last_runs(deck)
