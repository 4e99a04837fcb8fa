"""Columns of a case table: arrays, or numbers that are computed on demand.

A sweep of a hundred million cases takes no memory: a task that runs cases `first` to `last` computes only their values,
the same bits each time. A computed column is used like an array: `column[rows]`, `len(column)`; numpy can convert it to
one, which puts all of it in memory.

The cases of a sweep are the product of its axes, the last of which varies fastest, as digits of a number do. So the
values of a row follow by dividing its number. Rows that `exclude when` drops are kept as one bit for each row of the
product.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from met.distinct import distinct
from met.frozen import frozen
from met.trace.graph import Formulas

LISTED_ROWS = 10_000
"""Largest number of rows of a table whose columns are arrays."""

MOST_SWEPT = 100_000_000
"""Largest number of cases of a sweep: as many were run (docs/cluster.md)."""


class ComputedColumn:
    """Numbers that are computed on demand, by `at`, and can be indexed like an array of one dimension."""

    ndim = 1

    def __init__(self, count: int, dtype: Any = np.float64) -> None:
        self.size, self.dtype = count, np.dtype(dtype)

    def at(self, rows: np.ndarray) -> np.ndarray:
        """The numbers of these rows, which must be in the column."""
        raise NotImplementedError

    @property
    def shape(self) -> tuple[int]:
        return (self.size,)

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, key: Any) -> Any:
        """The numbers of these rows, computed now. key: as of a numpy array of one dimension."""
        if isinstance(key, slice):
            return self.at(np.arange(*key.indices(self.size)))
        rows = np.asarray(key)
        if rows.dtype == bool:
            rows = np.flatnonzero(rows)
        rows = rows.astype(np.int64)
        rows = np.where(rows < 0, rows + self.size, rows)
        if ((rows < 0) | (rows >= self.size)).any():
            raise IndexError(f"a row beyond the {self.size} of this column")
        return self.at(rows) if rows.ndim else self.at(rows[None])[0]

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        out = np.empty(self.size, self.dtype if dtype is None else dtype)
        for rows in blocks(self.size):
            out[rows] = self[rows]
        return out

    @cached_property
    def ends(self) -> tuple[int, int]:
        """The first row in which the column is least, and the first in which it is largest."""
        low = high = 0
        least, largest = np.inf, -np.inf
        for rows in blocks(self.size):
            values = self[rows]
            first, last = int(np.argmin(values)), int(np.argmax(values))
            if values[first] < least:
                low, least = rows.start + first, values[first]
            if values[last] > largest:
                high, largest = rows.start + last, values[last]
        return low, high

    def tolist(self) -> list[Any]:
        return np.asarray(self).tolist()


CaseValues = np.ndarray | ComputedColumn
"""A column of a case table, a number a case."""


class CountedRows(ComputedColumn):
    """Consecutive whole numbers from 0, or from `first`: all rows of a table."""

    def __init__(self, count: int, first: int = 0) -> None:
        super().__init__(count, np.int64)
        self.first = first

    def at(self, rows: np.ndarray) -> np.ndarray:
        return rows + self.first if self.first else rows


class AxisColumn(ComputedColumn):
    """A coordinate of a sweep: for each case, one of the values of an axis."""

    def __init__(self, rows: SweptRows, axis: int, values: CaseValues) -> None:
        super().__init__(rows.count)
        self.rows, self.axis, self.values = rows, axis, values

    def at(self, rows: np.ndarray) -> np.ndarray:
        return np.asarray(self.values[self.rows.index(self.axis, rows)], dtype=float)

    @cached_property
    def ends(self) -> tuple[int, int]:
        """The first row in which the axis' value is least, and the first in which it is largest."""
        if self.rows.kept is not None:
            return super().ends
        chosen = self.rows.chosen[self.axis]
        least, largest = ends(self.values if chosen is None else np.asarray(self.values[chosen]))
        return self.rows.first_with(self.axis, least), self.rows.first_with(self.axis, largest)


class PositionColumn(ComputedColumn):
    """Positions of the cases of one structure in the table of their sweep, which has other structures too.

    among  rows of the product of all axes that are cases of any structure; None: all of them
    """

    def __init__(self, rows: SweptRows, among: RowBits | None = None) -> None:
        super().__init__(rows.count)
        self.rows, self.among = rows, among

    def at(self, rows: np.ndarray) -> np.ndarray:
        numbers = self.rows.number(rows)
        return (numbers if self.among is None else self.among.rank(numbers)).astype(float)


class ShiftedColumn(ComputedColumn):
    """The numbers of another column plus a constant; as whole numbers where `dtype` says so."""

    def __init__(self, values: CaseValues, by: int, dtype: Any = np.float64) -> None:
        super().__init__(len(values), dtype)
        self.values, self.by = values, by

    def at(self, rows: np.ndarray) -> np.ndarray:
        return (self.values[rows] + self.by).astype(self.dtype)


class FormulaColumn(ComputedColumn):
    """The values of one output of a formula in each case. values: of its inputs, by name."""

    def __init__(self, formula: Formulas, values: Mapping[str, CaseValues], count: int) -> None:
        super().__init__(count)
        self.formula, self.values = formula, {name: values[name] for name in formula.inputs}

    def at(self, rows: np.ndarray) -> np.ndarray:
        numbers = self.formula.replay({name: np.asarray(column[rows]) for name, column in self.values.items()})[0]
        return np.array(np.broadcast_to(np.asarray(numbers, dtype=float), len(rows)))


def listed(column: ComputedColumn) -> CaseValues:
    """The column as an array if it is short, else unchanged."""
    return np.asarray(column) if column.size <= LISTED_ROWS else column


def all_rows(count: int) -> CaseValues:
    """The rows of a table with `count` rows, each once and in order."""
    return np.arange(count) if count <= LISTED_ROWS else CountedRows(count)


def places_among(rows: CaseValues, wanted: np.ndarray) -> np.ndarray:
    """The places at which the wanted rows would be inserted into the ascending `rows`."""
    if isinstance(rows, CountedRows):
        return np.clip(wanted - rows.first, 0, rows.size)
    return np.searchsorted(rows, wanted)


def are_among(rows: CaseValues, wanted: np.ndarray) -> np.ndarray:
    """True for each wanted row that is in the ascending `rows`."""
    if isinstance(rows, CountedRows):
        return np.asarray((wanted >= rows.first) & (wanted < rows.first + rows.size))
    return np.isin(wanted, rows)


def row_at(column: CaseValues, number: int) -> int | None:
    """The row with this number in a column of ascending numbers; None where there is none."""
    row = bisect_left(column, number)
    return row if row < len(column) and column[row] == number else None


def ends(column: CaseValues) -> tuple[int, int]:
    """The first row in which a column is least, and the first in which it is largest."""
    return column.ends if isinstance(column, ComputedColumn) else (int(np.argmin(column)), int(np.argmax(column)))


def span(column: CaseValues) -> tuple[float, float]:
    """The least and the largest number of a column."""
    least, largest = ends(column)
    return float(column[least]), float(column[largest])


def different(column: CaseValues) -> np.ndarray:
    """The distinct values of a column, ascending."""
    if isinstance(column, AxisColumn):
        return distinct(np.asarray(column.values[column.rows.present(column.axis)]))
    return distinct(np.asarray(column))


BLOCK = 1 << 16
"""Number of rows that are processed together, which bounds memory however long a table is."""


def blocks(count: int, size: int | None = None) -> Iterator[slice]:
    """Consecutive ranges of `size` rows; None: `BLOCK`."""
    size = size or BLOCK
    return (slice(first, min(first + size, count)) for first in range(0, count, size))


class RowBits:
    """One bit for each row, set where the row counts. packed: eight to a byte, the first row in the highest bit."""

    def __init__(self, packed: np.ndarray, count: int) -> None:
        self.packed, self.count = packed, count

    @staticmethod
    def of(flags: np.ndarray) -> RowBits:
        return RowBits(np.packbits(flags), len(flags))

    def __getitem__(self, rows: slice) -> np.ndarray:
        """A truth for each of these rows that says whether it counts; they begin at a multiple of 8."""
        return np.unpackbits(self.packed[rows.start // 8 : -(-rows.stop // 8)], count=rows.stop - rows.start).view(bool)

    @cached_property
    def _before(self) -> np.ndarray:
        """The number of rows that count before each block, and then the total."""
        counts = [int(np.count_nonzero(self[rows])) for rows in blocks(self.count)]
        return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])

    @property
    def set(self) -> int:
        """The number of rows that count."""
        return int(self._before[-1])

    def select(self, places: np.ndarray) -> np.ndarray:
        """The rows at these places among the counting ones."""
        block = np.searchsorted(self._before, places, side="right") - 1
        selected = np.empty(len(places), np.int64)
        for number, in_block in _alike(block):
            first = number * BLOCK
            rows = np.flatnonzero(self[slice(first, min(first + BLOCK, self.count))])
            selected[in_block] = first + rows[places[in_block] - self._before[number]]
        return selected

    def rank(self, rows: np.ndarray) -> np.ndarray:
        """The number of counting rows before each of these."""
        ranks = np.empty(len(rows), np.int64)
        for number, in_block in _alike(rows // BLOCK):
            first = number * BLOCK
            flags = self[slice(first, min(first + BLOCK, self.count))]
            before = np.cumsum(flags, dtype=np.int64) - flags
            ranks[in_block] = self._before[number] + before[rows[in_block] - first]
        return ranks


def _alike(numbers: np.ndarray) -> Iterator[tuple[int, np.ndarray | slice]]:
    """Each distinct number, with the places that have it."""
    if len(numbers) and (np.diff(numbers) >= 0).all():
        edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist(), len(numbers)]
        for first, last in itertools.pairwise(edges):
            yield int(numbers[first]), slice(first, last)
        return
    for number in np.unique(numbers).tolist():
        yield number, np.flatnonzero(numbers == number)


@frozen
class SweptRows:
    """Rows of the product of a sweep's axes, ascending: the cases of one of its structures.

    sizes   the number of values of each axis, the outermost first
    chosen  of each axis, the values that these cases have by their places, rising; None: all
    kept    of the product of these values, the rows that are cases; None: all
    """

    sizes: tuple[int, ...]
    chosen: tuple[np.ndarray | None, ...]
    kept: RowBits | None = None

    @cached_property
    def lengths(self) -> tuple[int, ...]:
        """The number of values of each axis that these cases have."""
        pairs = zip(self.sizes, self.chosen, strict=True)
        return tuple(size if chosen is None else len(chosen) for size, chosen in pairs)

    @cached_property
    def product(self) -> int:
        """The number of rows of the product of the values that these cases have."""
        return math.prod(self.lengths)

    @property
    def count(self) -> int:
        return self.product if self.kept is None else self.kept.set

    def only(self, bits: RowBits) -> SweptRows:
        """These rows, of which none is left out yet, restricted to the kept ones."""
        return SweptRows(self.sizes, self.chosen, bits)

    def index(self, axis: int, rows: np.ndarray) -> np.ndarray:
        """The value of an axis in each of these rows, by its place."""
        inner = rows if self.kept is None else self.kept.select(rows)
        return self._index(axis, inner)

    def first_with(self, axis: int, place: int) -> int:
        """The first row of the product with the axis' value at this place among those that these cases have."""
        return place * math.prod(self.lengths[axis + 1 :])

    def number(self, rows: np.ndarray) -> np.ndarray:
        """The place of each of these rows in the product of all values of all axes."""
        inner = rows if self.kept is None else self.kept.select(rows)
        if all(chosen is None for chosen in self.chosen):
            return inner
        numbers = np.zeros(len(rows), np.int64)
        for axis, size in enumerate(self.sizes):
            numbers = numbers * size + self._index(axis, inner)
        return numbers

    def present(self, axis: int) -> np.ndarray:
        """The places of the axis' values that occur in these rows, ascending."""
        size, chosen = self.sizes[axis], self.chosen[axis]
        if self.kept is None:
            return np.arange(size) if chosen is None else chosen
        seen = np.zeros(size, bool)
        for piece in blocks(self.count):
            seen[self.index(axis, np.arange(piece.start, piece.stop))] = True
        return np.flatnonzero(seen)

    def _index(self, axis: int, inner: np.ndarray) -> np.ndarray:
        """The place of an axis' value in each of these rows of the product."""
        after, length, chosen = math.prod(self.lengths[axis + 1 :]), self.lengths[axis], self.chosen[axis]
        place = inner if after == 1 else inner // after
        if axis and any(other > 1 for other in self.lengths[:axis]):
            place = place % length
        return place if chosen is None else chosen[place]
