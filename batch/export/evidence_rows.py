"""The table of evidence as columns, for `csv` and `parquet`: a row for each requirement at a design point."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from batch.archive.read import ArchiveFile
from batch.export.case_table import NumberOfUnit, TableColumn
from batch.queries.evidence_table import RequirementEvidence, requirement_evidence
from batch.queries.pool import by_run, groups_named
from met.frozen import frozen
from met.unit_parser import decimals


@frozen
class EvidenceColumns:
    """The rows of runs and sweeps. deck: numbers in the deck's units, else SI; each row names its own"""

    runs: tuple[str, ...]
    rows: tuple[RequirementEvidence, ...]
    fields: tuple[TableColumn, ...]
    deck: bool

    @property
    def count(self) -> int:
        return len(self.rows)

    def blocks(self) -> Iterator[list[list[object]]]:
        """All rows at once: the values of each field, None where a cell is empty."""
        yield [[self._cell(field, row) for row in self.rows] for field in self.fields]

    def _cell(self, field: TableColumn, row: RequirementEvidence) -> object:
        """A cell of the table of evidence, in the deck's unit or SI; None for an empty one."""
        value = getattr(row, field.name)
        if field.name == "unit":
            return row.unit if self.deck else row.si_unit
        if field.name in IN_UNIT and value is not None and self.deck:
            return NumberOfUnit(decimals([value], row.unit)[0]) if row.scale != 1.0 else float(value)
        return None if value == "" else value


IN_UNIT = ("limit", "percentile_bound", "worst", "margin", "step_error")
"""Columns whose numbers are in the unit of the row."""

COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("run", "str", "run or sweep"),
    ("requirement", "str", "as the deck wrote it"),
    ("at", "str", "design point: what was chosen"),
    ("metric", "str", "of which it is"),
    ("unit", "str", "of limit, percentile_bound, worst, margin and step_error"),
    ("comparison", "str", "of the metric with the limit"),
    ("limit", "float", "that is required"),
    ("share", "float", "of cases that is to meet it; empty where every case is"),
    ("confidence", "float", "with which the share is to be shown"),
    ("verdict", "str", "what follows"),
    ("cases", "int", "that were judged"),
    ("missed", "int", "cases that miss it, failed, or have no value"),
    ("share_met", "float", "of the cases that were run"),
    ("at_least", "float", "share of all cases that meet it, lower bound"),
    ("at_most", "float", "share of all cases that meet it, upper bound"),
    ("percentile_bound", "float", "of the percentile, on the side of the limit"),
    ("worst", "float", "value nearest to the limit or furthest beyond it"),
    ("worst_case", "int", "position of that case in the case table"),
    ("margin", "float", "from the worst value to the limit"),
    ("sigmas", "float", "from the mean to the limit, in standard deviations over the drawn cases"),
    ("step_error", "float", "of the metric by the step, largest of the verified cases"),
    ("more_cases", "int", "that would demonstrate it if none of them misses it"),
    ("test", "str", "of verdict and bounds: fixed, or sequential, looked at after every case"),
    ("decided", "int", "cases after which a sequential test decided it"),
    ("why", "str", "it was not judged as it asks for"),
    ("again", "str", "command that runs the worst case"),
)
"""Fields of `RequirementEvidence` in the order of a table: name, kind, about."""


def evidence_columns(file: ArchiveFile, runs: Sequence[str], *, deck: bool = False) -> EvidenceColumns:
    """The table of evidence (what the cases show of each requirement) of these runs and sweeps, of all if none is
    named. Raises Problem E325."""
    groups = groups_named(file, tuple(runs))
    rows = requirement_evidence(groups, file.path.name, several=len(by_run(file.groups)) > 1)
    fields = tuple(
        TableColumn(name, "" if kind == "str" or name in IN_UNIT else "1", about, kind) for name, kind, about in COLUMNS
    )
    return EvidenceColumns(tuple(by_run(groups)), tuple(rows), fields, deck)
