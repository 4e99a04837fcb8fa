"""`met export`: a face of batch.export."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import click

from batch.formats import FORMATS
from met.cli import YES, format_option, loudness_options
from met.host.streams import kept
from met.messages.visible import say

if TYPE_CHECKING:
    from batch.export.formats import Rows


@click.command(short_help="Write an archive for Foxglove (MCAP), or as a table (CSV, Parquet).")
@click.argument("archive", metavar="ARCHIVE")
@click.option("-o", "--output", metavar="FILE", help="The file to write; its ending selects the format [ARCHIVE.mcap].")
@click.option("--to", "kind", type=click.Choice(list(FORMATS)), help="The format, whatever the name of the file.")
@click.option("--run", "runs", multiple=True, metavar="NAME", help="This run or sweep [the first]; may be repeated.")
@click.option(
    "--case",
    "cases",
    multiple=True,
    metavar="ID",
    help="Only this case: the beginning of its id, or its position, as '#0'; may be repeated, and the first is then "
    "drawn solid.",
)
@click.option("--signals", multiple=True, metavar="LIST", help="Only these signals: qd,elbow.q; may be repeated [all].")
@click.option(
    "--histories/--metrics",
    "histories",
    default=None,
    help="Of a table: a row for each instant, or a row for each case [a case of a sweep; an instant with --case or "
    "--signals].",
)
@click.option(
    "--evidence",
    is_flag=True,
    help="Of a table: a row for each requirement at each design point, with share, bounds, worst case, margin and "
    "verdict; of all runs unless --run names some.",
)
@click.option(
    "--units",
    type=click.Choice(["si", "deck"]),
    default="si",
    show_default=True,
    help="Of a table: metrics and varied values in SI units, or in those of the deck; signals are in SI units.",
)
@click.option("--layout", is_flag=True, help="Also write a layout for Foxglove, FILE.layout.json.")
@click.option("--no-meshes", is_flag=True, help="Of an MCAP: draw links by their shapes, without their meshes.")
@click.option("--force", is_flag=True, help="Overwrite an existing file, whatever it is.")
@format_option
@loudness_options
def export(
    archive: str,
    output: str | None,
    kind: str | None,
    runs: tuple[str, ...],
    cases: tuple[str, ...],
    signals: tuple[str, ...],
    histories: bool | None,
    evidence: bool,
    units: Literal["si", "deck"],
    layout: bool,
    no_meshes: bool,
    force: bool,
    form: str,
    quiet: bool,
    verbose: bool,
) -> int:
    """Write an archive for other tools.

    MCAP opens in Foxglove and Lichtblick: the arm moves in 3D, without a URDF, beside its signals and messages; several
    cases are overlaid. CSV and Parquet are tables: of a sweep, a row for each case, with its varied values and metrics;
    of a run, or with --histories, a row for each instant, with the signals; with --evidence, a row for each
    requirement.
    """
    import json

    from batch.export import export, summary
    from ic.printing.columns import size

    names = [name.strip() for signal in signals for name in signal.split(",") if name.strip()]
    if evidence and histories is not None:
        raise click.UsageError("--evidence is a table of its own: leave out --histories or --metrics")
    table: Rows | None = None if histories is None else "histories" if histories else "metrics"
    table = "evidence" if evidence else table
    done = export(
        archive,
        output,
        form=kind,
        runs=runs,
        cases=cases,
        signals=names,
        table=table,
        units=units,
        layout=layout,
        force=force,
        meshes=not no_meshes,
    )
    written = [path for path in (done.path, done.layout) if path is not None]
    if done.note and not quiet:
        say(f"note: {done.note}", err=True)
    with kept(f"{done.path} is whole"):
        if form == "json":
            facts = {
                "written": [str(path) for path in written],
                "cases": done.cases,
                "rows": done.rows,
                "table": done.table,
            }
            click.echo(json.dumps(facts, indent=1))
        elif not quiet:
            for path in written:
                say(f"{path}  ({size(path.stat().st_size)}){summary(done) if path == done.path else ''}")
    return YES
