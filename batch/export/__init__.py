"""Archives in other tools' formats: `met export`.

picking    which cases, and which numbers of them
output     what may be written over, and a file that has its name only when it is whole
mcap       for Foxglove and Lichtblick: the arm in 3D, signals, what came of it; made of
  poses      where the links are
  scene      what they look like
  said       what is logged of a case, and its result
  wire       messages of our own
layout     what Foxglove shows when it opens one
cases      a table of cases: what is varied, metrics, requirements
csv        a table as text, of cases or of histories
parquet    the same for other programs; needs pyarrow
straight   an export that a run is asked for
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from met.diagnostic import Problem, error
from met.frozen import frozen

if TYPE_CHECKING:
    from batch.archive.read import ArchiveFile

Rows = Literal["metrics", "histories"]
"""What a row of a table is: a case with its metrics, or an instant of a case."""

FORMATS = ("mcap", "csv", "parquet")
"""By which a file's ending is known."""


@frozen
class Exported:
    """What was written: the file, and the layout beside it where one was asked for; cases, and rows of all of them;
    what a row is."""

    path: Path
    layout: Path | None
    cases: int
    rows: int
    table: Rows = "histories"


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
) -> Exported:
    """Write an archive for another tool: histories, or a table of cases with their metrics.

    output   the file; None: the archive's name with the ending of `form`
    form     "mcap", "csv" or "parquet"; None: by the ending of `output`, and mcap where there is no output
    runs     names of runs and sweeps; none: the first one
    cases    `7`, `"#7"`, or the beginnings of case_ids, in the order in which they are wanted; none: all, of histories
             those that are kept
    signals  as `met plot` takes them: `qd`, `elbow.q`; none: all
    table    of CSV and Parquet, what a row is: "metrics" a case, "histories" an instant; None: a case of what has
             several, unless cases or signals are named
    units    of CSV and Parquet: "deck" for metrics and what is varied as the deck writes them; signals are in SI
    layout   of an MCAP: also write how Foxglove shows it, in `<output>.layout.json`
    force    write over a file that is there, whatever it is

    Raises met.diagnostic.Problem for what a user can mend.
    """
    from batch.archive.read import ArchiveFile
    from batch.export import cases as tables
    from batch.export import csv, mcap, parquet
    from batch.export import layout as layouts
    from batch.export.output import check
    from batch.export.picking import pick

    form, target = settled(archive, output, form)
    if layout and form != "mcap":
        helps = "`-o FILE.mcap` writes one, and its layout"
        raise Problem(error("E375", f"a layout shows an MCAP file, and {target} is none", help=helps))
    _fits(form, target, table, units, signals)
    with ArchiveFile(Path(archive)) as file:
        check(target, file.path, owner(form), force=force)
        names, deck = [f"#{case}" if isinstance(case, int) else case for case in cases], units == "deck"
        writer = csv if form == "csv" else parquet
        if form != "mcap" and (table or _row(file, runs, names, signals)) == "metrics":
            found = tables.table(file, runs, names, deck=deck)
            return Exported(target, None, found.count, writer.write_cases(file, found, target), "metrics")
        picked = pick(file, runs, names, signals)
        if form != "mcap":
            return Exported(target, None, len(picked), writer.write(file, picked, target, deck=deck))
        arms = mcap.arms(file, picked, named=bool(cases))
        if not layout:
            return Exported(target, None, len(picked), mcap.write(file, arms, target))
        told = layouts.text(arms)
        place = layouts.beside(target)
        check(place, file.path, lambda path: path.read_text("utf-8", "replace") == told, force=force)
        rows = mcap.write(file, arms, target)
        layouts.write(place, told)
    return Exported(target, place, len(picked), rows)


def _fits(form: str, target: Path, table: Rows | None, units: str, signals: Sequence[str]) -> None:
    """That what a table is to be is asked of one. Raises Problem E376."""
    if form == "mcap" and table == "metrics":
        raise Problem(error("E376", f"{target} would hold histories: an MCAP file is no table of metrics",
                            help="`-o FILE.csv` writes one; in an MCAP file they are in `/result`"))  # fmt: skip
    if form == "mcap" and units != "si":
        raise Problem(error("E376", f"{target} would be in SI: an MCAP file has no other units",
                            help="`-o FILE.csv` can be in the deck's"))  # fmt: skip
    if table == "metrics" and signals:
        raise Problem(error("E376", f"signals are histories: a table of metrics has no `{signals[0]}`",
                            help="leave out `--metrics`, or `--signals`"))  # fmt: skip


def _row(file: ArchiveFile, runs: Sequence[str], cases: Sequence[str], signals: Sequence[str]) -> Rows:
    """What a row of a table is where nobody says it."""
    from batch.terminal.show import chosen

    groups = chosen(file, tuple(runs) or (file.groups[0].sweep or file.groups[0].name,))
    several = sum(group.count for group in groups) > 1
    return "metrics" if several and not cases and not signals else "histories"


def owner(form: str) -> Callable[[Path], bool]:
    """Whether a file is an export of this format that may be written over unasked."""
    from batch.export import csv, mcap, parquet

    return {"mcap": mcap.own, "csv": csv.own, "parquet": parquet.own}[form]


def what(done: Exported) -> str:
    """What was written, in words."""
    cases = f"{done.cases:,} case{'s' if done.cases != 1 else ''}"
    if done.table == "metrics":
        return f": metrics of {cases}, a row each" + ("; `--histories` writes signals" if done.cases != 1 else "")
    return f": histories of {cases}, {done.rows:,} row{'s' if done.rows != 1 else ''}"


def settled(
    archive: str | os.PathLike[str], output: str | os.PathLike[str] | None, form: str | None
) -> tuple[str, Path]:
    """The format and the file, of which one may follow from the other. Raises Problem E371."""
    if output is None:
        form = form or FORMATS[0]
        return form, Path(archive).with_suffix(f".{form}")
    target = Path(output)
    form = form or target.suffix.lower().removeprefix(".")
    if form not in FORMATS:
        helps = ("formats are known by their endings: .mcap, .csv, .parquet", "`--to csv` says it for any other name")
        raise Problem(error("E371", f"{target} does not say in which format it is to be", help=helps))
    return form, target
