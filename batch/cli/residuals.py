"""`met residuals`: a face of batch.measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from batch.cli.quantities import INSTANT
from met.cli import YES, format_option
from met.messages.visible import line, say

Face = TypeVar("Face", bound=Callable[..., Any])


def column_option(face: Face) -> Face:
    """The option --column of commands that read a log, passed as `columns`."""
    return click.option(
        "--column",
        "columns",
        multiple=True,
        metavar="CHANNEL=COLUMN [UNIT]",
        help="The log's column of a channel, or of `time`, under another name, with a sign or a factor, "
        "and a constant: 'elbow.q=-angle_2 + 12 [deg]', 'elbow.tau=95.8 * current_2 [N*m]'; may be repeated.",
    )(face)


@click.command(short_help="Compare a run with a log of measured signals.")
@click.argument("archive", metavar="ARCHIVE")
@click.argument("log", metavar="LOG")
@click.option("--run", "run", metavar="NAME", help="This run or sweep of the archive [the first].")
@click.option("--case", "case", metavar="ID", help="This case: the beginning of its id, or its position, as '#0' [#0].")
@click.option(
    "--picture", metavar="FILE", help="Draw each channel as measured and computed, and the rest: .png, .svg or .pdf."
)
@column_option
@click.option(
    "--zero",
    type=INSTANT,
    default="0 s",
    metavar="TIME",
    help="The log's time at which the run begins: '12.5 s'; of a log that is 4 ms late, '4 ms'.  [0 s]",
)
@format_option
def residuals(
    archive: str,
    log: str,
    run: str | None,
    case: str | None,
    picture: str | None,
    columns: tuple[str, ...],
    zero: float,
    form: str,
) -> int:
    """Compare a run with LOG, a CSV or MCAP file of the real arm's signals: how far what was measured is from what was
    computed, and whether the rest is noise.

    The head of a CSV file names `time [s]` and signals that the run records, each with its unit: `elbow.q [deg]`. Where
    a residual is no noise, what it follows is told, such as the sign of the joint's rate, as dry friction leaves it;
    and columns with another unit or sign, exchanged columns and a late clock are.
    """
    import json

    from batch.archive.read import ArchiveFile
    from batch.measured.log import mapped_column, read_log
    from batch.measured.paired import computed
    from batch.measured.residuals import compare
    from batch.modules.description import described_columns
    from batch.plotting import logs as pictures
    from batch.plotting import output as places
    from batch.queries.pool import groups_named
    from batch.queries.signals import case_text
    from batch.terminal.residuals import as_data, residual_lines
    from met.diagnostic import Problem, error
    from met.outputs import path_of

    output = None if picture is None else path_of(picture)
    if output is not None:
        places.check(output)
    with ArchiveFile(archive) as file:
        group = groups_named(file, [run] if run is not None else [])[0]
        position = group.recorded_position(case if case is not None else "#0")
        experiment = next(experiment for experiment in file.plan().experiments if experiment.name == group.name)
        recorded = described_columns(experiment)
        measured = read_log(log, recorded, [mapped_column(column) for column in columns], zero)
        joints = [joint.name for joint in experiment.structure.joints]
        courses = computed(group, position, recorded)
        comparison = compare(courses, recorded, joints, measured)
        if not comparison.residuals:
            message = f"no number of `{log}` has one of the run beside it"
            raise Problem(
                error("E478", message, measured.head, help="let its times begin where the run begins, at 0 s")
            )
        if output is not None:
            units = {column["channel"]: column["unit"] for column in recorded}
            title = f"{group.name}, {case_text(group, position)}, and {log}"
            pictures.draw(title, pictures.panels(measured, units, {"computed": courses}), output)
        if form == "json":
            say(
                json.dumps(
                    {"experiment": group.name, "case": case_text(group, position), **as_data(comparison)}, indent=1
                )
            )
        else:
            failed = ", which did not end well: as far as it came" if group.values("status")[position] else ""
            head = f"{group.name}, {case_text(group, position)}{failed}"
            say("\n".join(map(line, [head, "", *residual_lines(comparison)])))
    return YES
