"""CSV files that a deck names: found, read once, looked into column by column; every fault placed in the file.

    # what stands here is for the reader
    time [s], shoulder [deg], elbow [deg]
    0,        0,              10

The first line that is neither empty nor begins with `#` names the columns, each with its unit in square brackets.
Commas part them, but not between double quotes; spaces around a cell do not count, nor do double quotes around all of
it. A line has as many cells as the first. UTF-8, with or without a byte order mark, lines ended in any of the three
ways.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from functools import partial

from ic.grammar.syntax import Deck
from ic.language.unit_words import in_degrees, units_of
from ic.named_files import NamedFiles
from ic.text.complaints import known_words
from ic.text.files import decode
from met import units
from met.diagnostic import Label, Place, Problem, did_you_mean, error, write, write_either
from met.frozen import frozen
from met.host.files import memory, read_regular
from met.messages.other_units import suggest
from met.unit_parser import parse_unit
from met.units import PURE, Dimension, Measure

LONGEST_NAME = 40  # characters of a column's name that a message shows

_HEADER = re.compile(r"(?P<name>[^\[\]]*)(?:\[(?P<unit>[^\[\]]*)\])?")  # spaces are cut off later, not tried here
_CELL = re.compile(r',((?:[^",]|"[^"]*")*)')  # with the comma before it
WORD = re.compile(r"[^\W\d]\w*")  # of a cell, and of a row's name
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


UNITS, MOST_REMARKS = "# units: ", 100
"""The beginning of a line above a head that has the columns' units, and how many lines above a head may be it."""


@frozen
class CsvColumn:
    """A column as described by its head: number, name, unit as written (None where there is none), place of its head,
    and units of the deck's own in its unit, which no CSV file can use."""

    number: int
    name: str
    unit: str | None
    place: Place
    declared: tuple[str, ...] = ()


@frozen
class CsvCell:
    """A cell: its column, its text without spaces and quotes around it, and its place."""

    column: CsvColumn
    text: str
    place: Place


@frozen
class CsvTable:
    """A file's columns, and its rows as written: number of the line (from 1) and its text."""

    file: str
    columns: tuple[CsvColumn, ...]
    rows: tuple[tuple[int, str], ...]

    def column(self, name: str) -> CsvColumn | None:
        return next((column for column in self.columns if column.name == name), None)

    def numbers(self, column: CsvColumn, text: str, dimension: Dimension, label: Label) -> tuple[float, ...]:
        """The column in SI. text, dimension: the unit that is wanted; label: the part that needs it.

        Raises Problem D193 for its unit, D194 for a cell that is no number.
        """
        return self._numbers(column, _measure(column, text, dimension, label))

    def quantities(self, column: CsvColumn) -> tuple[tuple[float, ...], Measure]:
        """The column in SI, and the meaning of its own unit. Raises Problem D193, D194."""
        measure = units.ONE if column.unit is None else _meaning(column, (), ())
        return self._numbers(column, measure), measure

    def cell(self, column: CsvColumn, number: int) -> CsvCell:
        """The cell of a column in the row of this number, from 0."""
        line, row = self.rows[number]
        cells = _cells(row)
        text, gap = _stripped(cells[column.number])
        start = sum(len(cell) + 1 for cell in cells[: column.number]) + gap
        return CsvCell(column, text, Place(self.file, line, start + 1, max(len(text), 1)))

    def quantity(self, cell: CsvCell) -> tuple[float, Measure]:
        """The number of a cell in SI, and the meaning of its column's unit. Raises Problem D193, D194."""
        measure = units.ONE if cell.column.unit is None else _meaning(cell.column, (), ())
        number = _si(cell.text, measure)
        if number is None:
            raise _no_number(cell, measure)
        return number, measure

    def check_numbers(self, column: CsvColumn) -> None:
        """Raise Problem D193, D194 where a cell of the column is neither a number nor empty."""
        measure = _meaning(column, (), ())
        for number in range(len(self.rows)):
            text = self._text(column, number)
            if text and _si(text, measure) is None:
                raise _no_number(self.cell(column, number), measure)

    def words(self, column: CsvColumn) -> list[tuple[str, Place]] | None:
        """The column's cells and their places, where they are words and it has no unit; None where they are numbers.

        Raises Problem D194 for a cell that is not a word below one that is.
        """
        if column.unit is not None or not self.rows or not WORD.fullmatch(self._text(column, 0)):
            return None
        cells = [self.cell(column, number) for number in range(len(self.rows))]
        for cell in cells:
            if not WORD.fullmatch(cell.text):
                raise Problem(
                    error(
                        "D194",
                        f"`{cell.text[:40]}` is no word" if cell.text else "there is no word here",
                        cell.place,
                        also=[Label(cells[0].place, "this column begins with one")],
                        help="a column without a unit holds words, or pure numbers",
                    )
                )
        return [(cell.text, cell.place) for cell in cells]

    def _numbers(self, column: CsvColumn, measure: Measure) -> tuple[float, ...]:
        """The numbers of a column in SI. Raises Problem for a cell without one."""
        numbers = []
        for number in range(len(self.rows)):
            si = _si(self._text(column, number), measure)
            if si is None:
                raise _no_number(self.cell(column, number), measure)
            numbers.append(si)
        return tuple(numbers)

    def _text(self, column: CsvColumn, number: int) -> str:
        return _stripped(_cells(self.rows[number][1])[column.number])[0]

    def rising(self, column: CsvColumn, times: tuple[float, ...]) -> None:
        """Raise Problem D195 where the column's numbers, its times, do not rise."""
        for n, (before, after) in enumerate(itertools.pairwise(times)):
            if not before < after:
                raise Problem(
                    error(
                        "D195",
                        f"times of a file rise, and {after:g} s follows {before:g} s",
                        self.cell(column, n + 1).place,
                        also=[Label(self.cell(column, n).place, "the row before")],
                        help="sort the rows; for a jump, two times close together",
                    )
                )


def _si(text: str, measure: Measure) -> float | None:
    """The number of a cell in SI; None where it is not one, or does not fit in a double."""
    number = measure.to_si(float(text), text) if _NUMBER.fullmatch(text) else math.inf
    lost = number == 0.0 and any(digit in "123456789" for digit in text.lower().partition("e")[0])
    return None if lost or not math.isfinite(number) else number


def _no_number(cell: CsvCell, measure: Measure) -> Problem:
    """The error for a cell without a number for `_si`."""
    text = cell.text
    mistake = f"`{text[:40]}` is not a number" if text else "there is no number here"
    if _NUMBER.fullmatch(text):
        lost = measure.to_si(float(text), text) == 0.0
        mistake = "this number is too " + ("small: it would become 0" if lost else "large: the largest is 1.8e308")
    return Problem(
        error(
            "D194",
            mistake,
            cell.place,
            also=[Label(cell.column.place, f"column `{cell.column.name}`")],
            help="a number is written as 12.5 or -1e-3, with a point and without a unit",
        )
    )


def csv_files(deck: Deck) -> NamedFiles[CsvTable]:
    """The CSV files that a deck names."""
    return NamedFiles(
        deck,
        partial(_table, declared=frozenset(deck.units)),
        kind="CSV file",
        ending=".csv",
        most=memory(),
        missing="D190",
    )


def read_csv(path: str) -> CsvTable:
    """A CSV file from a command line. Raises Problem D190 where it cannot be read, and D002, D191 to D198."""
    try:
        data = read_regular(path)
    except OSError as reason:
        raise Problem(error("D190", f"cannot read the CSV file `{path}`: {reason.strerror}")) from None
    text, fault = decode(data, path, "CSV file")
    if fault is not None:
        raise Problem(fault)
    return _table(path, text)


def _table(file: str, text: str, declared: Collection[str] = ()) -> CsvTable:
    """A file's table. declared: the units of the deck's own."""
    lines = _lines_with_cells(text)
    head = next(lines, None)
    if head is None:
        raise Problem(
            error(
                "D191",
                f"`{file}` is empty",
                Place(file, 1, 1),
                help="its first line names the columns, as in `time [s], shoulder [deg]`",
            )
        )
    columns = _with_units(file, text, head[0], tuple(_columns(file, *head, declared)))
    rows = []
    for line, row in lines:
        count = len(_cells(row))
        if count != len(columns):
            raise Problem(
                error(
                    "D197",
                    f"this row has {count} {'cell' if count == 1 else 'cells'}, and the first line names "
                    f"{len(columns)} columns",
                    Place(file, line, 1, max(len(row), 1)),
                    also=[Label(Place(file, head[0], 1, len(head[1])), "the columns")],
                    help="commas part the cells, and a number has a decimal point",
                )
            )
        rows.append((line, row))
    return CsvTable(file, columns, tuple(rows))


def _with_units(file: str, text: str, head: int, columns: tuple[CsvColumn, ...]) -> tuple[CsvColumn, ...]:
    """The columns with the units of a line `# units: s,rad` above their head, as `met export` writes them, where none
    has a unit in the head. Raises Problem D197 where that line does not have a unit for each column."""
    if head < 2 or any(column.unit is not None for column in columns):
        return columns
    above = text.split("\n", min(head - 1, MOST_REMARKS))[: head - 1]
    line, units_line = next(
        ((n, text_line) for n, text_line in enumerate(above, 1) if text_line.startswith(UNITS)), (0, "")
    )
    if not line:
        return columns
    cells = [_stripped(cell)[0] for cell in _cells(units_line.removeprefix(UNITS))]
    if len(cells) != len(columns):
        message = f"this line has {len(cells)} units, and {len(columns)} columns follow"
        helps = "give each column its unit, and 1 where it has none"
        raise Problem(error("D197", message, Place(file, line, 1, max(len(units_line.rstrip()), 1)), help=helps))
    return tuple(replace(column, unit=unit or None) for column, unit in zip(columns, cells, strict=True))


def _lines_with_cells(text: str) -> Iterator[tuple[int, str]]:
    """Lines that are neither empty nor a remark, with their numbers from 1.

    They are cut one by one, so that a mistake in the first lines of a long file is found at once.
    """
    start = 0
    for number in itertools.count(1):
        end = text.find("\n", start)
        line = text[start:] if end < 0 else text[start:end]
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line
        if end < 0:
            return
        start = end + 1


def _columns(file: str, line: int, row: str, declared: Collection[str]) -> Iterator[CsvColumn]:
    """The columns that the first line names, with their units. Raises Problem D191 and others."""
    if all(_NUMBER.fullmatch(_stripped(cell)[0]) for cell in _cells(row)):
        raise Problem(
            error(
                "D191",
                "the first line names no columns: it holds numbers",
                Place(file, line, 1, max(len(row), 1)),
                help="put a line above them, as in `time [s], shoulder [deg]`",
            )
        )
    seen: dict[str, Place] = {}
    start = 0
    for number, cell in enumerate(_cells(row)):
        text, gap = _stripped(cell)
        place = Place(file, line, start + gap + 1, max(len(text), 1))
        start += len(cell) + 1
        match = _HEADER.fullmatch(text)
        name, unit = (match["name"].strip(), (match["unit"] or "").strip()) if match is not None else ("", "")
        if not name:
            helps = ["write the unit in square brackets behind the name, as in `shoulder [deg]`"]
            if number == 0 and "," not in row and re.search(r"[;\t]", row):
                helps = ["commas part the columns, as in `time [s], shoulder [deg]`"]
            raise Problem(
                error(
                    "D191",
                    f"`{text[:40]}` does not name a column" if text else "a column without a name",
                    place,
                    help=helps,
                )
            )
        if name in seen:
            raise Problem(
                error(
                    "D198",
                    f"column `{name}` is there twice",
                    place,
                    also=[Label(seen[name], "first")],
                    help="give one of them another name",
                )
            )
        seen[name] = place
        own = tuple(word for word in re.findall(r"\w+", unit) if word in declared)
        yield CsvColumn(number, name, unit or None, place, own)


def _cells(row: str) -> list[str]:
    """The cells of a line, with the spaces and quotes around them: `"1,000"` is one. A quote without its other is a
    letter."""
    if '"' not in row or row.count('"') % 2:
        return row.split(",")
    return _CELL.findall(f",{row}")


def _stripped(cell: str) -> tuple[str, int]:
    """A cell without the spaces and quotes around it, and the number of characters removed before it."""
    text = cell.strip()
    gap = len(cell) - len(cell.lstrip()) if text else 0
    if len(text) > 1 and text[0] == text[-1] == '"':
        inner = text[1:-1]
        return inner.strip(), gap + 1 + len(inner) - len(inner.lstrip())
    return text, gap


def _measure(column: CsvColumn, text: str, dimension: Dimension, label: Label) -> Measure:
    """The measure of a column's unit. Raises Problem D193 where it has none, or a different one from the wanted one."""
    usual = in_degrees(text)
    helps = write_either((f"{column.name} [{unit}]" for unit in usual), old=column.name)
    others = [unit for unit in units_of(dimension) if unit not in usual]
    further = [f"other units of this kind: {', '.join(others)}"] if others else []
    if column.unit is None:
        if dimension == PURE:
            return units.ONE
        raise Problem(
            error("D193", f"column `{column.name}` has no unit", column.place, also=[label], help=[helps, *further])
        )
    in_it = [f"{helps}, with numbers in that unit", *further]
    measure = _meaning(column, in_it, [label], dimension)
    if not units.same(measure.dimension, dimension):
        unit_words = "a pure number" if measure.dimension == PURE else f"in {units.text(measure.dimension)}"
        raise Problem(
            error(
                "D193",
                f"column `{column.name}` is {unit_words}, and {text} is needed",
                column.place,
                also=[label],
                help=in_it,
            )
        )
    return measure


def _meaning(
    column: CsvColumn, known: Iterable[str], also: Iterable[Label], dimension: Dimension | None = None
) -> Measure:
    """The measure of a column's unit. known: the remedy that names units, for one without a similar known one;
    dimension: the required one"""
    assert column.unit is not None
    try:
        return parse_unit(column.unit)
    except (ValueError, OverflowError, ZeroDivisionError):
        near = suggest(column.unit)
        if column.declared:
            helps = ["CSV files have the units of the language alone: write the numbers in one of these"]
        elif near is not None and (dimension is None or units.same(parse_unit(near).dimension, dimension)):
            helps = [write(near, f"did you mean `{column.name} [{near}]`?", old=column.unit)]
        else:
            helps = [*known] or [f"the units: {', '.join(units.ALL_UNITS)}"]
        raise Problem(error("D193", f"`{column.unit}` is not a unit", column.place, also=also, help=helps)) from None


def _short(name: str) -> str:
    return name if len(name) <= LONGEST_NAME else name[:LONGEST_NAME] + "..."


def missing_column(table: CsvTable, name: str, place: Place, why: str = "") -> Problem:
    """The error that a file lacks a column that is needed at this place. why: the reason, in words"""
    names = [_short(column.name) for column in table.columns]
    round_brackets = next((head for head in names if head.startswith(f"{name} (") and head.endswith(")")), None)
    near = did_you_mean(name, names)
    if round_brackets is not None:
        near = (f"a unit stands in square brackets: write `{name} [{round_brackets[len(name) + 2 : -1]}]`",)
    return Problem(
        error(
            "D192",
            f"`{table.file}` has no column `{name}`",
            place,
            also=[Label(table.columns[0].place, "its first line")],
            help=[*near, known_words("columns", names), *([why] if why else [])],
        )
    )
