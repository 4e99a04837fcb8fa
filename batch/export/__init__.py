"""Archives in other tools' formats: `met export`.

formats        the registry of file formats, and what each of them offers
picking        which cases, and which numbers of them
output         what may be written over, and a file that has its name only when it is whole
mcap           for Foxglove and Lichtblick: the arm in 3D, signals, what came of it; made of
  poses         where the links are
  scene         what they look like
  case_log      what is logged of a case, and its result
  wire          messages of our own
layout         what Foxglove shows when it opens one
tables         a table of cases: what is varied, metrics, requirements; or of requirements, with what the cases show
csv            a table as text, of cases or of histories
parquet        the same for other programs; needs pyarrow
from_run       an export that a run is asked for
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from batch.export.formats import ExportRequest, Rows, find
from batch.formats import FORMATS, endings, format_of
from ic.printing.columns import count
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.outputs import path_of

if TYPE_CHECKING:
    from batch.archive.read import ArchiveFile


@frozen
class Exported:
    """An export that was written.

    path    the file
    layout  the layout file beside it, where one was asked for
    cases   how many cases it has, 0 of evidence, and `rows` how many rows all of them have
    table   what a row is
    note    what is said of the meshes that were drawn; "" where there is nothing to say
    """

    path: Path
    layout: Path | None
    cases: int
    rows: int
    table: Rows = "histories"
    note: str = ""


def export(
    archive: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    form: str | None = None,
    runs: Sequence[str] = (),
    cases: Sequence[str | int] = (),
    signals: Sequence[str] = (),
    table: Rows | None = None,
    units: Literal["si", "deck"] = "si",
    layout: bool = False,
    force: bool = False,
    meshes: bool = True,
) -> Exported:
    """Write an archive for another tool: histories, or a table of cases with their metrics, or of requirements.

    output   the file; None: the archive's name with the ending of `form`
    form     a name in `batch.formats.FORMATS`, such as "csv"; None: by the ending of `output`, and mcap where
             there is no output
    runs     names of runs and sweeps; none: the first one, of evidence all
    cases    `7`, `"#7"`, or the beginnings of case_ids, in the order in which they are wanted; none: all, of histories
             those that are kept
    signals  as `met plot` takes them: `qd`, `elbow.q`; none: all
    table    what a row is: "metrics" a case, "histories" an instant, "evidence" a requirement at a design point; None:
             a case of what has several, unless cases or signals are named, in a format that can hold a table of metrics
    units    of a table: "deck" for metrics and what is varied as the deck writes them; signals are in SI
    layout   of an MCAP: also write how Foxglove shows it, in `<output>.layout.json`
    force    write over a file that is there, whatever it is
    meshes   of an MCAP: draw links by their meshes, from files that are there

    Raises met.diagnostic.Problem for mistakes that a user can correct.
    """
    from batch.archive.read import ArchiveFile
    from batch.export import tables
    from batch.export.output import check
    from batch.export.picking import pick

    form, target = format_and_target(archive, output, form)
    writer = find(form)
    request = ExportRequest(table, tuple(signals), units, layout, force, bool(cases), meshes)
    writer.check_request(request, target)
    with ArchiveFile(Path(archive)) as file:
        if table != "evidence" and not cases:
            file.need_every_row("a table of all cases")
        check(target, file.path, writer.is_own, force=force)
        names = [f"#{case}" if isinstance(case, int) else case for case in cases]
        only = writer.tables[0] if len(writer.tables) == 1 else None
        if table == "evidence":
            required = tables.evidence_columns(file, runs, deck=units == "deck")
            written = writer.write_table(file, required, target)
            return Exported(target, written.layout, 0, written.rows, "evidence")
        if (only or table or _row(file, runs, names, signals)) == "metrics":
            rows = tables.table(file, runs, names, deck=units == "deck")
            written = writer.write_table(file, rows, target)
            return Exported(target, written.layout, rows.count, written.rows, "metrics")
        picked = pick(file, runs, names, signals)
        written = writer.write_histories(file, picked, target, request)
    return Exported(target, written.layout, len(picked), written.rows, note=written.note)


def _row(file: ArchiveFile, runs: Sequence[str], cases: Sequence[str], signals: Sequence[str]) -> Rows:
    """The rows of a table by default: cases if there are several, else instants."""
    from batch.queries.pool import groups_named

    groups = groups_named(file, tuple(runs) or (file.groups[0].sweep or file.groups[0].name,))
    several = sum(group.count for group in groups) > 1
    return "metrics" if several and not cases and not signals else "histories"


def summary(done: Exported) -> str:
    """The contents of an export in words, for the line that names its file."""
    if done.table == "evidence":
        return f": evidence, {count(done.rows, 'row')}, one a requirement at a design point"
    cases = count(done.cases, "case")
    if done.table == "metrics":
        return f": metrics of {cases}, a row each" + ("; `--histories` writes signals" if done.cases != 1 else "")
    return f": histories of {cases}, {count(done.rows, 'row')}"


def format_and_target(
    archive: str | os.PathLike[str], output: str | os.PathLike[str] | None, form: str | None
) -> tuple[str, Path]:
    """The format and the file, of which one may follow from the other. Raises Problem E371."""
    if output is None:
        form = form or next(iter(FORMATS))
        return form, Path(archive).with_suffix(f".{form}")
    target = path_of(output)
    form = form or format_of(target)
    if form not in FORMATS:
        helps = (f"formats are known by their endings: {endings()}", "`--to csv` says it for any other name")
        raise Problem(error("E371", f"{target} does not say in which format it is to be", help=helps))
    return form, target
