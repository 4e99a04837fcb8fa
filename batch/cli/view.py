"""`met view`: a face of batch.portable."""

from __future__ import annotations

from pathlib import Path

import click

from met.cli import YES, loudness_options
from met.messages.visible import say


@click.command(short_help="Make one HTML page that runs an archive's cases again, under sliders.")
@click.argument("archive", metavar="ARCHIVE")
@click.argument("name", metavar="[NAME]", required=False)
@click.option("-o", "--output", metavar="FILE", help="The page [ARCHIVE.view.html].")
@loudness_options
def view(archive: str, name: str | None, output: str | None, quiet: bool, verbose: bool) -> int:
    """Write an archive's only run or sweep, or NAME, as a page with a slider for each number that is varied.

    Whoever opens it moves a slider, and the run is computed there, with the bits of the archive; where the archive
    has the case, the page compares. It is whole in one file and opens without a network.
    """
    from batch.portable import files
    from batch.portable.page import view as page
    from ic.printing.columns import size

    target = Path(archive).with_suffix(".view.html") if output is None else Path(output)
    files.check_page(target)
    files.write_page(page(archive, () if name is None else (name,)), target)
    if not quiet:
        say(f"{target}  ({size(target.stat().st_size)})")
    return YES
