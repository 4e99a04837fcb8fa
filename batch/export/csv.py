"""Histories as CSV: a row an instant, a column a number, the cases one under the other.

    # MET 0.1.0: gains of two_link.ic
    # units: 1,s,rad,rad,rad/s
    case,time,shoulder.q,elbow.q,shoulder.qd

`#` begins a comment (`pandas.read_csv(path, comment="#")`). Numbers are written so that reading gives the same bits.
The columns `run` and `case` are there where there are several.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from batch.archive.read import ArchiveFile
from batch.export.output import whole
from batch.export.picking import Case, Column
from met.version import VERSION


def own(path: Path) -> bool:
    """Whether a file may be written over unasked: a table may have been worked on, so never."""
    return False


def united(cases: Sequence[Case]) -> list[Column]:
    """The columns of all the cases: those of one structure may lack some of another's."""
    return list({column.path: column for case in cases for column in case.columns}.values())


def write(file: ArchiveFile, cases: Sequence[Case], output: Path) -> int:
    """Write the cases; the number of rows. Raises Problem E305."""
    columns, several = united(cases), len(cases) > 1
    runs = dict.fromkeys(case.asked for case in cases)
    heads = [*([("run", "")] if len(runs) > 1 else []), *([("case", "1")] if several else []), ("time", "s")]
    heads += [(column.path, column.unit) for column in columns]
    head = io.StringIO()
    lines = csv.writer(head, lineterminator="\n")
    head.write(f"# MET {VERSION}: {', '.join(runs)} of {' '.join(file.deck.split())}\n# units: ")
    lines.writerow([unit for _, unit in heads])
    lines.writerow([name for name, _ in heads])
    with whole(output) as sink:
        sink.write(memoryview(head.getvalue().encode("utf-8", "replace")))
        for case in cases:
            begin = [*([case.asked] if len(runs) > 1 else []), *([str(case.number)] if several else [])]
            cells = [texts(case.time), *_cells(case, columns)]
            rows = "".join(",".join((*begin, *row)) + "\n" for row in zip(*cells, strict=True))
            sink.write(memoryview(rows.encode()))
            sink.check()
    return sum(len(case.time) for case in cases)


def _cells(case: Case, columns: Sequence[Column]) -> list[list[str]]:
    """The numbers of each column as texts; empty ones where the case has no such column."""
    mine = {column.path: column for column in case.columns}
    signals = {name: case.signal(name) for name in dict.fromkeys(column.variable for column in case.columns)}
    return [
        texts(signals[mine[column.path].variable][:, mine[column.path].place])
        if column.path in mine
        else [""] * len(case.time)
        for column in columns
    ]


def texts(values: np.ndarray) -> list[str]:
    """The shortest text of each number that gives its bits again."""
    if values.dtype == np.float32:
        return [str(value) for value in values]
    return list(map(repr, values.tolist()))
