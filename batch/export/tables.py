"""Tables for `csv` and `parquet`: of cases, a row for each with its varied values, its end, its metrics, and whether it
meets each requirement; and of evidence, a row for each requirement at a design point."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.archive.stored import Stored
from batch.export.picking import rank
from batch.queries import requirements
from batch.queries.evidence_table import RequirementEvidence, requirement_evidence
from batch.queries.pool import STATUS, by_run, cases_named, groups_named
from met.frozen import frozen
from met.unit_parser import decimals

BLOCK = 10_000
"""Rows that are in memory at once."""

OUTCOME = {1: "met", 0: "missed"}


@frozen
class TableColumn:
    """A column of the table. kind: "float", "int" or "str"; variable: the archive's, which some structures may lack;
    in_unit: whether SI values become numbers of the unit."""

    name: str
    unit: str
    about: str
    kind: str
    variable: str = ""
    in_unit: bool = False


class NumberOfUnit(float):
    """A number of a unit, nearest to an SI value. Its `repr` is the decimal that gives the SI value again, which a
    double may miss by its last bit."""

    text: str

    def __new__(cls, text: str) -> NumberOfUnit:
        number = super().__new__(cls, text)
        number.text = text if not text.lstrip("-").isdecimal() else f"{text}.0"
        return number

    def __repr__(self) -> str:
        return self.text


@frozen
class CaseTable:
    """The cases of runs and sweeps. places: the group and the position in it of each row."""

    runs: tuple[str, ...]
    groups: tuple[ArchiveGroup, ...]
    places: tuple[np.ndarray, np.ndarray]
    fields: tuple[TableColumn, ...]

    @property
    def count(self) -> int:
        return len(self.places[0])

    def blocks(self) -> Iterator[list[list[object]]]:
        """All rows, a block at a time: the values of each field, None where a cell is empty."""
        for first in range(0, self.count, BLOCK):
            group_of, positions = (place[first : first + BLOCK] for place in self.places)
            yield [self._column(field, group_of, positions) for field in self.fields]

    def _column(self, field: TableColumn, group_of: np.ndarray, positions: np.ndarray) -> list[object]:
        """A column over the cases, each value from the case's group."""
        out: list[object] = [None] * len(positions)
        for number in np.unique(group_of).tolist():
            in_group = np.flatnonzero(group_of == number)
            values = _values(self.groups[number], field, positions[in_group])
            for place, value in zip(in_group.tolist(), values, strict=True):
                out[place] = value
        return out


def table(file: ArchiveFile, runs: Sequence[str], cases: Sequence[str], *, deck: bool = False) -> CaseTable:
    """The cases of these runs and sweeps (none: of the first), in the given order (none: all, by their positions).
    deck: numbers in the deck's units. Raises Problem E325, E328."""
    names = tuple(runs) or (file.groups[0].sweep or file.groups[0].name,)
    groups = groups_named(file, names)
    if cases:
        wanted = dict.fromkeys(
            (groups.index(group), int(position or 0))
            for case in cases
            for group, position in cases_named(file, names, case)
        )
        group_of, positions = np.array(list(wanted), np.int64).T
    else:
        group_of = np.repeat(np.arange(len(groups)), [group.count for group in groups])
        positions = np.concatenate([np.arange(group.count) for group in groups])
        numbers = np.concatenate([group.values("case") for group in groups])
        ranks = np.array([rank(names, group) for group in groups])[group_of]
        order = np.lexsort((numbers, ranks))
        group_of, positions = group_of[order], positions[order]
    return CaseTable(tuple(by_run(groups)), groups, (group_of, positions), tuple(_fields(groups, deck=deck)))


def _fields(groups: Sequence[ArchiveGroup], *, deck: bool) -> Iterator[TableColumn]:
    """The columns: the case, its varied values, its end, metrics, requirements."""
    if len(by_run(groups)) > 1:
        yield TableColumn("run", "", "run or sweep", "str")
    yield TableColumn("case", "1", "position in the case table", "int", "case")
    yield TableColumn("case_id", "", "name of the case", "str", "case_id")
    yield from varied_columns(groups, deck=deck)
    if any("repeat" in group.variables and group.values("repeat").any() for group in groups):
        yield TableColumn("repeat", "1", "repeat of noise", "int", "repeat")
    yield TableColumn("status", "", "how it ended", "str", "status")
    for variable in {v.name: v for group in groups for v in group.role("metric")}.values():
        unit, converted = in_unit(variable, deck=deck)
        yield TableColumn(variable.name, unit, variable.long_name, "float", variable.name, converted)
    watched = [v for role in ("limit", "grapple") for group in groups for v in group.role(role)]
    for variable in {v.name: v for v in watched}.values():
        yield TableColumn(variable.name, variable.unit, variable.long_name, "float", variable.name)
    for text in dict.fromkeys(text for group in groups for text in requirements.requirement_texts(group)):
        yield TableColumn(f"require {text}", "", "met, missed, or empty where that is not known", "str")
    if any((group.values("status") != 0).any() for group in groups):
        yield TableColumn("cause", "", "why it failed", "str", "cause")


def varied_columns(groups: Sequence[ArchiveGroup], *, deck: bool) -> list[TableColumn]:
    """The columns of what is varied in any of the groups: choices of structure, then numbers. deck: numbers in the
    deck's units"""
    variables = {v.name: v for role in ("choice", "coordinate") for group in groups for v in group.role(role)}
    return [_of_varied(variable, deck=deck) for variable in variables.values()]


def _of_varied(variable: Stored, *, deck: bool) -> TableColumn:
    """The column of a varied quantity: a deck may vary a `let run`."""
    name = f"coordinates.{variable.name}" if variable.name == "run" else variable.name
    if variable.role == "choice":
        return TableColumn(name, "", variable.long_name, "str", variable.name)
    unit, converted = in_unit(variable, deck=deck)
    return TableColumn(name, unit, variable.long_name, "float", variable.name, converted)


def in_unit(variable: Stored, *, deck: bool) -> tuple[str, bool]:
    """The unit of a variable's numbers, and whether it is another than SI. deck: the deck's unit, if it has one"""
    if not deck or "deck_unit" not in variable.attributes:
        return variable.unit, False
    return str(variable.attributes["deck_unit"]), float(variable.attributes.get("deck_scale", 1.0)) != 1.0


def value_of(field: TableColumn, group: ArchiveGroup, position: int) -> object:
    """The value of a varied parameter in one case; None where its structure does not have it."""
    [value] = _values(group, field, np.array([position]))
    return value


def _values(group: ArchiveGroup, field: TableColumn, positions: np.ndarray) -> list[object]:
    """The values of a column of a table of cases, as Python's own types; None where the group lacks it."""
    if field.name == "run" and not field.variable:
        return [group.sweep or group.name] * len(positions)
    if not field.variable:
        return _outcomes(group, field.name.removeprefix("require "), positions)
    if field.variable not in group.variables:
        return [None] * len(positions)
    values = group.at(field.variable, positions)
    if field.variable == "status":
        return [STATUS.get(int(value), "unknown") for value in values]
    if field.kind == "str":
        return [str(value) for value in values]
    if field.kind == "int":
        return [int(value) for value in values]
    return [NumberOfUnit(text) for text in decimals(values, field.unit)] if field.in_unit else list(map(float, values))


def _outcomes(group: ArchiveGroup, text: str, positions: np.ndarray) -> list[object]:
    """The outcome of a requirement in each case, in words; None where the group lacks it."""
    texts = requirements.requirement_texts(group)
    if text not in texts:
        return [None] * len(positions)
    outcomes = requirements.outcomes(group, positions)[:, texts.index(text)]
    return [OUTCOME.get(int(value)) for value in outcomes]


# Evidence


@frozen
class EvidenceColumns:
    """The evidence for the requirements of runs and sweeps. deck: numbers in the deck's units, else SI; each
    row names its own"""

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
