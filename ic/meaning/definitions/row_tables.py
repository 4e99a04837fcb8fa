"""Tables of values by the name of a row: `let bodies = csv("bodies.csv");`, then `bodies.boom.mass`.

    link,  mass [kg], com.x [m], com.y [m], com.z [m]
    boom,  12.5,      0.4,       0,         0
    stick, 7.1,       0.3,       0,         0.02

The first column names the rows. The others hold values in the unit of their head; without one they hold pure numbers,
or remarks, which are checked only when used. Columns `com.x`, `com.y` and `com.z` are the vector `com` too, and so are
`inertia.xx` to `inertia.yz`, in the order that `inertia` of a link has. An empty cell holds no value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final, TypeGuard

from ic.grammar.syntax import Call, Expression, Name, String, Word
from ic.meaning.definitions.csv_files import WORD, CsvCell, CsvColumn, CsvTable, missing_column
from ic.text.complaints import and_more, known_words
from met.diagnostic import Diagnostic, Label, Place, Problem, did_you_mean, error
from met.frozen import frozen

CSV: Final = "csv"
ALL: Final = "all"
USAGE: Final = 'write `let NAME = csv("FILE.csv");`'
VECTORS: Final = (("x", "y", "z"), ("xx", "yy", "zz", "xy", "xz", "yz"), ("xx", "yy", "zz"))
"""Last words of columns that form a vector together, in order."""


def is_row_table(value: Expression) -> TypeGuard[Call]:
    """Return True if a value is `csv("FILE.csv")`, or was meant to be."""
    return isinstance(value, Call) and value.name.text == CSV


@frozen
class RowTable:
    """A file whose rows have names: the number of each row by its name.

    all_used  the place of `rows = all`, by which a deck asks to be told of rows that nothing uses; None without it
    """

    csv: CsvTable
    rows: Mapping[str, int]
    all_used: Place | None = None

    def unused(self, let: str, used: Iterable[str]) -> Diagnostic | None:
        """The warning about rows that none of these paths names, if the deck asks for it. let: the table's name"""
        if self.all_used is None:
            return None
        named = {path[len(let) + 1 :].split(".")[0] for path in used if path.startswith(f"{let}.")}
        others = [name for name in self.rows if name not in named]
        if not others:
            return None
        place = self.csv.cell(self.csv.columns[0], self.rows[others[0]]).place
        message = f"nothing uses row `{others[0]}`{and_more(len(others) - 1)}"
        helps = [*([known_words("not used", others)] if len(others) > 1 else []), "leave `rows = all` out, or use them"]
        also = (Label(self.all_used, "all are to be used"),)
        return Diagnostic("D385", message, Label(place), also, tuple(helps), severity="warning")

    def cells(self, name: Name) -> tuple[CsvCell, ...]:
        """The cells of a path, `bodies.boom.mass`: one, or those of a vector. Raises Problem, placed."""
        if len(name.path) < 3:
            raise self._no_value(name)
        _, row, *words = name.path
        number = self.rows.get(row.text)
        if number is None:
            message = f"`{self.csv.file}` has no row `{row.text}`"
            near = did_you_mean(row.text, self.rows)
            raise Problem(error("D382", message, row.place, help=[*near, known_words("rows", self.rows)]))
        columns = self._columns(words)
        cells = tuple(self.csv.cell(column, number) for column in columns)
        for cell in cells:
            if not cell.text:
                also = [Label(name.place, f"`{name.text}`"), Label(cell.column.place, f"column `{cell.column.name}`")]
                helps = "fill it in, or leave the entry that asks for it out"
                raise Problem(error("D383", f"row `{row.text}` has no value here", cell.place, also=also, help=helps))
        return cells

    def paths(self) -> Iterator[str]:
        """The paths of all values, without the table's name: `boom.mass`; for a vector also its own."""
        columns = dict.fromkeys(column.name for column in self.csv.columns[1:])
        heads = dict.fromkeys(head for name in columns for head, dot, _ in [name.rpartition(".")] if dot)
        whole = [head for head in heads if any(all(f"{head}.{part}" in columns for part in parts) for parts in VECTORS)]
        return (f"{row}.{name}" for row in self.rows for name in (*whole, *columns))

    def _columns(self, words: Sequence[Word]) -> tuple[CsvColumn, ...]:
        """The column of this name, or those of the vector of this name."""
        text = ".".join(word.text for word in words)
        column = self.csv.column(text)
        if column is not None and column.number > 0:
            return (column,)
        for parts in VECTORS:
            several = [self.csv.column(f"{text}.{part}") for part in parts]
            columns = tuple(column for column in several if column is not None)
            if len(columns) == len(parts):
                return columns
        raise missing_column(self.csv, text, words[0].place)

    def _no_value(self, name: Name) -> Problem:
        """The error that a path names the table, or a row of it, and no value."""
        what = "a table" if len(name.path) == 1 else "a row of a table"
        columns = [column.name for column in self.csv.columns[1:]]
        rest = f".{columns[0] if columns else 'COLUMN'}"
        example = name.text + (rest if len(name.path) > 1 else f".{next(iter(self.rows), 'ROW')}{rest}")
        known = known_words("columns", columns) if len(name.path) > 1 else known_words("rows", self.rows)
        message = f"`{name.text}` is {what}, and a value is needed here"
        return Problem(error("D381", message, name.place, help=[f"a value of it is `{example}`", known]))


def row_table(call: Call, get: Callable[[String], CsvTable]) -> RowTable:
    """The table that `csv("FILE.csv")` names. get: of the files. Raises Problem, placed."""
    every = next((word.place for word, value in call.named if (word.text, _word(value)) == ("rows", ALL)), None)
    alone = len(call.positional) == 1 and call.body is None and len(call.named) == (every is not None)
    if not alone or not isinstance(call.positional[0], String):
        raise Problem(error("D381", "a table by row name is made of the name of a file", call.place, help=USAGE))
    named = call.positional[0]
    table = get(named)
    first, label = table.columns[0], Label(named.place, "read here")
    if first.unit is not None:
        helps = "the first column names the rows: put one before this, such as `link`"
        raise Problem(error("D382", f"column `{first.name}` has a unit", first.place, also=[label], help=helps))
    rows: dict[str, int] = {}
    for number in range(len(table.rows)):
        cell = table.cell(first, number)
        if not WORD.fullmatch(cell.text):
            message = f"`{cell.text[:40]}` is no name of a row" if cell.text else "a row without a name"
            helps = "a name has letters, digits and `_`, and begins with no digit: `bodies.boom_2.mass` asks for one"
            raise Problem(error("D382", message, cell.place, also=[label], help=helps))
        if cell.text in rows:
            also = [Label(table.cell(first, rows[cell.text]).place, "first"), label]
            helps = "take one of the two out, or give it another name"
            raise Problem(error("D382", f"row `{cell.text}` is there twice", cell.place, also=also, help=helps))
        rows[cell.text] = number
    for column in table.columns[1:]:
        if column.unit is not None:
            table.check_numbers(column)
    return RowTable(table, rows, every)


def _word(value: Expression) -> str:
    return value.text if isinstance(value, Name) else ""
