"""Tables as a Parquet file: those of batch/export/csv.py, with the run and the case in each.

A column's metadata has its `unit` and `about`; the file's has `met.export`, as JSON. It is made by pyarrow, which is
too large (170 MB) to come with MET unasked.
"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile
from batch.archive.sink import temporary_of
from batch.campaigns.campaign import Campaign
from batch.export.csv import all_columns
from batch.export.formats import ExportFormat, ExportRequest, WrittenExport
from batch.export.output import whole
from batch.export.picking import ExportedCase, SignalColumn
from batch.export.tables import CaseTable, EvidenceColumns, TableColumn, value_of, varied_columns
from met.diagnostic import Problem, error
from met.host.files import open_regular
from met.version import VERSION

MAGIC = b"PAR1"
ABOUT = "met.export"

COMPRESSION = "snappy"
"""Compression of the columns, which every reader of Parquet has; ZSTD packs better, but some lack it."""

GROUP_ROWS = 100_000
"""Approximate number of rows of a row group, which holds whole cases."""


def _about(file: ArchiveFile, runs: Iterable[str]) -> dict[str, str]:
    """The metadata of a Parquet file: the archive, the deck and the versions that it is from."""
    about = {
        "archive": file.path.name,
        "deck": file.deck,
        "runs": list(runs),
        "met": VERSION,
        "provenance": file.provenance,
    }
    return {ABOUT: json.dumps(about)}


def pyarrow_here() -> tuple[Any, Any]:
    """The modules pyarrow and pyarrow.parquet. Raises Problem E373 where they are missing."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as reason:
        install = f"`{shlex.quote(sys.executable)} -m pip install pyarrow` brings it to the Python that runs MET"
        helps = (install, "`-o FILE.csv` writes the same as text")
        raise Problem(error("E373", "Parquet files are written by pyarrow, which is not here", help=helps)) from reason
    return pyarrow, parquet


def _schema(
    arrow: Any, cases: Sequence[ExportedCase], alike: Sequence[TableColumn], columns: Sequence[SignalColumn]
) -> Any:
    """Names, types and units of the columns: the case, varied values, the time, the signals."""
    double = {
        column.path
        for case in _one_each(cases)
        for column in case.columns
        if case.signal(column.variable).dtype != np.float32
    }
    fields = [arrow.field("run", arrow.string()), arrow.field("case", arrow.int64())]
    for field in alike:
        kind = arrow.string() if field.kind == "str" else arrow.float64()
        fields.append(arrow.field(field.name, kind, metadata=_metadata(field.unit, field.about)))
    fields.append(arrow.field("time", arrow.float64(), metadata=_metadata("s", "time")))
    for column in columns:
        kind = arrow.float64() if column.path in double else arrow.float32()
        fields.append(arrow.field(column.path, kind, metadata=_metadata(column.unit, column.about)))
    return arrow.schema(fields)


def _metadata(unit: str, about: str) -> dict[str, str]:
    return {"unit": unit, "about": about}


def _one_each(cases: Sequence[ExportedCase]) -> list[ExportedCase]:
    """One of the exported cases of each structure of their sweeps."""
    return list({case.group.name: case for case in cases}.values())


def _table(arrow: Any, schema: Any, case: ExportedCase, fields: Sequence[TableColumn]) -> Any:
    """A case as a table; nulls in columns that it does not have."""
    rows = len(case.time)
    alike: dict[str, Any] = {"run": case.run_name, "case": case.number}
    alike |= {field.name: value_of(field, case.group, case.position) for field in fields}
    arrays: dict[str, Any] = {"time": case.time, **case.values()}
    arrays_ = []
    for field in schema:
        if field.name in arrays:
            arrays_.append(arrow.array(arrays[field.name], field.type))
        else:
            arrays_.append(arrow.repeat(arrow.scalar(alike.get(field.name), field.type), rows))
    return arrow.Table.from_arrays(arrays_, schema=schema)


class Parquet(ExportFormat):
    """The Parquet format, for other programs; needs pyarrow."""

    title = "a Parquet file"

    def is_own(self, path: Path) -> bool:
        """Return True where the last bytes of the file, which describe it, are those of an export of MET's."""
        with open_regular(path) as file:
            size = file.seek(0, 2)
            file.seek(max(0, size - 8))
            end = file.read()
            if end[4:] != MAGIC:
                return False
            file.seek(max(0, size - 8 - int.from_bytes(end[:4], "little")))
            return ABOUT.encode() in file.read()

    def check_campaign(self, campaign: Campaign, target: Path) -> None:
        pyarrow_here()

    def write_table(self, file: ArchiveFile, table: CaseTable | EvidenceColumns, target: Path) -> WrittenExport:
        """Write a table of cases, or of evidence. Raises Problem E305, E373."""
        arrow, parquet = pyarrow_here()
        kinds = {"float": arrow.float64(), "int": arrow.int64(), "str": arrow.string()}
        fields = [
            arrow.field(field.name, kinds[field.kind], metadata=_metadata(field.unit, field.about))
            for field in table.fields
        ]
        schema = arrow.schema(fields).with_metadata(_about(file, table.runs))
        with whole(target) as sink:
            with parquet.ParquetWriter(str(temporary_of(target)), schema, compression=COMPRESSION) as writer:
                for columns in table.blocks():
                    arrays = [arrow.array(values, field.type) for values, field in zip(columns, schema, strict=True)]
                    writer.write_table(arrow.Table.from_arrays(arrays, schema=schema))
            sink.check()
        return WrittenExport(table.count)

    def write_histories(
        self, file: ArchiveFile, cases: Sequence[ExportedCase], target: Path, request: ExportRequest
    ) -> WrittenExport:
        """Write the histories of these cases. Raises Problem E305, and E373 where there is no pyarrow."""
        arrow, parquet = pyarrow_here()
        columns, runs = all_columns(cases), dict.fromkeys(case.run_name for case in cases)
        fields = varied_columns([case.group for case in _one_each(cases)], deck=request.units == "deck")
        schema = _schema(arrow, cases, fields, columns).with_metadata(_about(file, runs))
        with whole(target) as sink:
            with parquet.ParquetWriter(str(temporary_of(target)), schema, compression=COMPRESSION) as writer:
                waiting: list[Any] = []
                for case in cases:
                    waiting.append(_table(arrow, schema, case, fields))
                    if sum(map(len, waiting)) >= GROUP_ROWS:
                        writer.write_table(arrow.concat_tables(waiting))
                        waiting = []
                if waiting:
                    writer.write_table(arrow.concat_tables(waiting))
            sink.check()
        return WrittenExport(sum(len(case.time) for case in cases))


FORMAT = Parquet()
