"""Histories as a Parquet file: the table of batch/export/csv.py, with what is varied as columns too.

A column's metadata has its `unit` and `about`; the file's has `met.export`, as JSON. It is made by pyarrow, which is
too large (170 MB) to come with MET unasked.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, Stored
from batch.archive.sink import temporary_of
from batch.export.csv import united
from batch.export.output import whole
from batch.export.picking import Case, Column
from met.diagnostic import Problem, error
from met.version import VERSION

MAGIC = b"PAR1"
ABOUT = "met.export"

GROUP_ROWS = 100_000
"""Rows of a row group, about: those of whole cases."""


def own(path: Path) -> bool:
    """Whether a file is an export of MET's: its last bytes describe it."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - 8))
        end = file.read()
        if end[4:] != MAGIC:
            return False
        file.seek(max(0, size - 8 - int.from_bytes(end[:4], "little")))
        return ABOUT.encode() in file.read()


def write(file: ArchiveFile, cases: Sequence[Case], output: Path) -> int:
    """Write the cases; the number of rows. Raises Problem E305, and E373 where there is no pyarrow."""
    arrow, parquet = pyarrow_here()
    columns, runs = united(cases), dict.fromkeys(case.asked for case in cases)
    told = {"archive": file.path.name, "deck": file.deck, "runs": list(runs), "met": VERSION,
            "provenance": file.provenance}  # fmt: skip
    schema = _schema(arrow, cases, columns).with_metadata({ABOUT: json.dumps(told)})
    with whole(output) as sink:
        with parquet.ParquetWriter(str(temporary_of(output)), schema, compression="zstd") as writer:
            waiting: list[Any] = []
            for case in cases:
                waiting.append(_table(arrow, schema, case))
                if sum(map(len, waiting)) >= GROUP_ROWS:
                    writer.write_table(arrow.concat_tables(waiting))
                    waiting = []
            if waiting:
                writer.write_table(arrow.concat_tables(waiting))
        sink.check()
    return sum(len(case.time) for case in cases)


def pyarrow_here() -> tuple[Any, Any]:
    """pyarrow and its parquet. Raises Problem E373 where there is none."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as reason:
        helps = ("`pip install pyarrow`, or `pip install 'met-arm[parquet]'`", "`-o FILE.csv` writes the same as text")
        raise Problem(error("E373", "Parquet files are written by pyarrow, which is not here", help=helps)) from reason
    return pyarrow, parquet


def _schema(arrow: Any, cases: Sequence[Case], columns: Sequence[Column]) -> Any:
    """Names, types and units: what case it is, what is varied, the time, the signals."""
    double = {column.path for case in _one_each(cases) for column in case.columns
              if case.signal(column.variable).dtype != np.float32}  # fmt: skip
    fields = [arrow.field("run", arrow.string()), arrow.field("case", arrow.int64())]
    for variable in _varied(cases):
        kind = arrow.string() if variable.role == "choice" else arrow.float64()
        fields.append(arrow.field(_apart(variable), kind, metadata=_told(variable.unit, variable.long_name)))
    fields.append(arrow.field("time", arrow.float64(), metadata=_told("s", "time")))
    for column in columns:
        kind = arrow.float64() if column.path in double else arrow.float32()
        fields.append(arrow.field(column.path, kind, metadata=_told(column.unit, column.about)))
    return arrow.schema(fields)


def _told(unit: str, about: str) -> dict[str, str]:
    return {"unit": unit, "about": about}


def _one_each(cases: Sequence[Case]) -> list[Case]:
    """A case of each structure."""
    return list({case.group.name: case for case in cases}.values())


def _varied(cases: Sequence[Case]) -> list[Stored]:
    """What is varied in any of the cases: choices of structure, then numbers."""
    groups = [case.group for case in _one_each(cases)]
    found = {v.name: v for role in ("choice", "coordinate") for group in groups for v in group.role(role)}
    return list(found.values())


def _apart(variable: Stored) -> str:
    """The column of what is varied: a deck may vary a `let run`."""
    return f"coordinates.{variable.name}" if variable.name == "run" else variable.name


def _table(arrow: Any, schema: Any, case: Case) -> Any:
    """A case as a table; nulls in columns that it does not have."""
    rows = len(case.time)
    alike: dict[str, Any] = {"run": case.asked, "case": case.number}
    alike |= {_apart(v): case.group.at(v.name, [case.position])[0] for v in _varied([case])}
    arrays: dict[str, Any] = {"time": case.time}
    signals = {name: case.signal(name) for name in dict.fromkeys(column.variable for column in case.columns)}
    arrays |= {column.path: signals[column.variable][:, column.place] for column in case.columns}
    made = []
    for field in schema:
        if field.name in arrays:
            made.append(arrow.array(arrays[field.name], field.type))
        else:
            value = alike.get(field.name)
            value = value.item() if isinstance(value, np.generic) else value
            made.append(arrow.repeat(arrow.scalar(value, field.type), rows))
    return arrow.Table.from_arrays(made, schema=schema)
