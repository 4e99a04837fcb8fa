"""Archives in other tools' formats: `met export`.

    picking    which cases, and which numbers of them
    output     what may be written over, and a file that has its name only when it is whole
    mcap       for Foxglove and Lichtblick: the arm in 3D, signals, what came of it; made of
      poses      where the links are
      scene      what they look like
      said       what is logged of a case, and its result
      wire       messages of our own
    layout     what Foxglove shows when it opens one
    csv        a table as text
    parquet    a table for other programs; needs pyarrow
    straight   an export that a run is asked for
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from met.diagnostic import Problem, error
from met.frozen import frozen

FORMATS = ("mcap", "csv", "parquet")
"""By which a file's ending is known."""


@frozen
class Exported:
    """What was written: the file, and the layout beside it where one was asked for; cases, and rows of all of them."""

    path: Path
    layout: Path | None
    cases: int
    rows: int


def export(
    archive: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    form: str | None = None,
    runs: Sequence[str] = (),
    cases: Sequence[str | int] = (),
    signals: Sequence[str] = (),
    layout: bool = False,
    force: bool = False,
) -> Exported:
    """Write an archive's histories for another tool.

    output   the file; None: the archive's name with the ending of `form`
    form     "mcap", "csv" or "parquet"; None: by the ending of `output`, and mcap where there is no output
    runs     names of runs and sweeps; none: the first one
    cases    `7`, `"#7"`, or the beginnings of case_ids, in the order in which they are wanted; none: all that have
             histories
    signals  as `met plot` takes them: `qd`, `elbow.q`; none: all
    layout   of an MCAP: also write how Foxglove shows it, in `<output>.layout.json`
    force    write over a file that is there, whatever it is

    Raises met.diagnostic.Problem for what a user can mend.
    """
    from batch.archive.read import ArchiveFile
    from batch.export import csv, mcap, parquet
    from batch.export import layout as layouts
    from batch.export.output import check
    from batch.export.picking import pick

    form, target = settled(archive, output, form)
    if layout and form != "mcap":
        helps = "`-o FILE.mcap` writes one, and its layout"
        raise Problem(error("E375", f"a layout shows an MCAP file, and {target} is none", help=helps))
    with ArchiveFile(Path(archive)) as file:
        check(target, file.path, owner(form), force=force)
        picked = pick(file, runs, [f"#{case}" if isinstance(case, int) else case for case in cases], signals)
        if form != "mcap":
            rows = csv.write(file, picked, target) if form == "csv" else parquet.write(file, picked, target)
            return Exported(target, None, len(picked), rows)
        arms = mcap.arms(file, picked, named=bool(cases))
        if not layout:
            return Exported(target, None, len(picked), mcap.write(file, arms, target))
        told = layouts.text(arms)
        place = layouts.beside(target)
        check(place, file.path, lambda path: path.read_text("utf-8", "replace") == told, force=force)
        rows = mcap.write(file, arms, target)
        layouts.write(place, told)
    return Exported(target, place, len(picked), rows)


def owner(form: str) -> Callable[[Path], bool]:
    """Whether a file is an export of this format that may be written over unasked."""
    from batch.export import csv, mcap, parquet

    return {"mcap": mcap.own, "csv": csv.own, "parquet": parquet.own}[form]


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
