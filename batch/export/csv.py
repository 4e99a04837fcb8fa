"""Tables as CSV: of cases, a row each; of histories, a row an instant, the cases one under the other.

    # MET 0.1.0: gains of two_link.ic
    # units: 1,V*s/rad,s,rad,rad,rad/s
    case,gearbox.kp,time,shoulder.q,elbow.q,shoulder.qd

`#` begins a comment (`pandas.read_csv(path, comment="#")`). Numbers are written so that reading gives the same bits.
Histories have the column `run` where there are several runs, and `case` and varied parameters for cases. No name begins
like a spreadsheet's formula.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from batch.archive.read import ArchiveFile
from batch.export.formats import ExportFormat, ExportRequest, WrittenExport
from batch.export.output import whole
from batch.export.picking import ExportedCase, SignalColumn
from batch.export.tables import CaseTable, EvidenceColumns, TableColumn, value_of, varied_columns
from met.messages.visible import line
from met.version import VERSION

BEGINS = "=+-@\t\r\uff1d\uff0b\uff0d\uff20"
"""Characters by which a spreadsheet takes a cell for a formula; no name of a deck begins with one."""


NUMBER = re.compile("[0-9]+(e[0-9]+)?")
"""A case_id, of sixteen digits from 0 to f, that a reader takes for a number, as one in a thousand."""


def safe_word(text: str) -> str:
    """A word that no spreadsheet takes for a formula: an apostrophe is put before one that looks like it, and before a
    word that begins with an apostrophe, so that the original is always found by removing the first."""
    return f"'{text}" if text[:1] in (*BEGINS, "'") else text


def _remark(text: str) -> str:
    """Text after `#`, with an apostrophe where a spreadsheet, which cuts it into cells, would see a formula."""
    return re.sub(rf"([,;]\s*)(?=[{re.escape(BEGINS)}])", r"\1'", line(text))


def _cell(text: str) -> str:
    """A word as a cell, in quotes where it needs them."""
    if text.isalnum():
        return text
    out = io.StringIO()
    csv.writer(out, lineterminator="").writerow([safe_word(text)])
    return out.getvalue()


def all_columns(cases: Sequence[ExportedCase]) -> list[SignalColumn]:
    """The columns of all the cases: those of one structure may lack some of another's."""
    return list({column.path: column for case in cases for column in case.columns}.values())


def _head(file: ArchiveFile, runs: Iterable[str], heads: Sequence[tuple[str, str]]) -> bytes:
    """The first lines: the contents of the table, the columns' units, their names."""
    head = io.StringIO()
    lines = csv.writer(head, lineterminator="\n")
    about = _remark(f"{', '.join(runs)} of {' '.join(file.deck.split())}")
    head.write(f"# MET {VERSION}: {about}\n# units: ")
    lines.writerow([safe_word(line(unit)) for _, unit in heads])
    lines.writerow([safe_word(name) for name, _ in heads])
    return head.getvalue().encode("utf-8", "replace")


def _column(field: TableColumn, values: Sequence[object]) -> list[str]:
    """The cells of a column; a case_id that reads as a number, such as 93556390810e0238, gets an apostrophe before
    it."""
    if field.variable == "case_id":
        return [f"'{value}" if NUMBER.fullmatch(str(value)) else _cell(str(value)) for value in values]
    return _line(values)


def _line(cells: Sequence[object]) -> list[str]:
    """Cells of a CSV line: numbers as by `repr`, words in quotes where they need them."""
    return [_cell(cell) if isinstance(cell, str) else "" if cell is None else repr(cell) for cell in cells]


def _cells(case: ExportedCase, columns: Sequence[SignalColumn]) -> list[list[str]]:
    """The numbers of each column as texts; empty ones where the case lacks the column."""
    values, empty = case.values(), [""] * len(case.time)
    return [number_texts(values[column.path]) if column.path in values else empty for column in columns]


def number_texts(values: np.ndarray) -> list[str]:
    """The shortest text of each number that gives the same bits when read."""
    if values.dtype == np.float32:
        return [str(value) for value in values]
    return list(map(repr, values.tolist()))


class Csv(ExportFormat):
    """The CSV format. Existing tables are not overwritten without --force, since a user may have edited them."""

    title = "a CSV file"

    def write_table(self, file: ArchiveFile, table: CaseTable | EvidenceColumns, target: Path) -> WrittenExport:
        """Write a table of cases, or of evidence. Raises Problem E305."""
        with whole(target) as sink:
            sink.write(memoryview(_head(file, table.runs, [(field.name, field.unit) for field in table.fields])))
            for columns in table.blocks():
                cells = [_column(field, values) for field, values in zip(table.fields, columns, strict=True)]
                rows = "".join(",".join(row) + "\n" for row in zip(*cells, strict=True))
                sink.write(memoryview(rows.encode("utf-8", "replace")))
                sink.check()
        return WrittenExport(table.count)

    def write_histories(
        self, file: ArchiveFile, cases: Sequence[ExportedCase], target: Path, request: ExportRequest
    ) -> WrittenExport:
        """Write the histories of these cases. Raises Problem E305."""
        columns, groups = all_columns(cases), list({case.group.name: case.group for case in cases}.values())
        runs = dict.fromkeys(case.run_name for case in cases)
        fields = varied_columns(groups, deck=request.units == "deck")
        numbered = len(cases) > 1 or bool(fields)
        heads = [*([("run", "")] if len(runs) > 1 else []), *([("case", "1")] if numbered else [])]
        heads += [*((field.name, field.unit) for field in fields), ("time", "s")]
        heads += [(column.path, column.unit) for column in columns]
        with whole(target) as sink:
            sink.write(memoryview(_head(file, runs, heads)))
            for case in cases:
                begin: list[object] = [case.run_name] if len(runs) > 1 else []
                begin += [case.number] if numbered else []
                begin += [value_of(field, case.group, case.position) for field in fields]
                cells = [number_texts(case.time), *_cells(case, columns)]
                same = _line(begin)
                rows = "".join(",".join((*same, *row)) + "\n" for row in zip(*cells, strict=True))
                sink.write(memoryview(rows.encode("utf-8", "replace")))
                sink.check()
        return WrittenExport(sum(len(case.time) for case in cases))


FORMAT = Csv()
