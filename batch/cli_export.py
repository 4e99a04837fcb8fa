"""`met export`: a face of batch.export."""

from __future__ import annotations

import click

from met.cli import YES, format_option, loudness_options


@click.command(short_help="Write an archive for Foxglove (MCAP), or as a table (CSV, Parquet).")
@click.argument("archive", metavar="ARCHIVE")
@click.option("-o", "--output", metavar="FILE", help="The file; its ending says the format [ARCHIVE.mcap].")
@click.option("--to", "kind", type=click.Choice(["mcap", "csv", "parquet"]), help="The format, for any name.")
@click.option("--run", "runs", multiple=True, metavar="NAME", help="This run or sweep [the first]; may be repeated.")
@click.option("--case", "cases", multiple=True, metavar="ID", help="Only this case: the beginning of its id, or '#0'; "
              "may be repeated, and the first is then drawn solid.")  # fmt: skip
@click.option("--signals", multiple=True, metavar="LIST", help="Only these: qd,elbow.q; may be repeated [all].")
@click.option("--layout", is_flag=True, help="Also write how Foxglove shows it, in FILE.layout.json.")
@click.option("--force", is_flag=True, help="Write over a file that is there, whatever it is.")
@format_option
@loudness_options
def export(
    archive: str, output: str | None, kind: str | None, runs: tuple[str, ...], cases: tuple[str, ...],
    signals: tuple[str, ...], layout: bool, force: bool, form: str, quiet: bool, verbose: bool,
) -> int:  # fmt: skip
    """Write the histories of an archive for other tools.

    MCAP opens in Foxglove and Lichtblick: the arm moves in 3D, without a URDF, beside its signals and what was said of
    it; several cases are overlaid. CSV and Parquet are tables of the signals.
    """
    import json

    from batch.export import export
    from ic.printing.columns import size

    names = [name.strip() for each in signals for name in each.split(",") if name.strip()]
    done = export(archive, output, form=kind, runs=runs, cases=cases, signals=names, layout=layout, force=force)
    written = [path for path in (done.path, done.layout) if path is not None]
    if form == "json":
        told = {"written": [str(path) for path in written], "cases": done.cases, "rows": done.rows}
        click.echo(json.dumps(told, indent=1))
    elif not quiet:
        for path in written:
            click.echo(f"{path}  ({size(path.stat().st_size)})")
    return YES
