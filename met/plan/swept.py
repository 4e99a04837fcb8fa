"""Rows of a sweep's product that are cases, given by a few numbers instead of a list, and the values of each row.

The cases of a sweep are the product of its axes, the last of which varies fastest, as digits of a number do. So the
values of a row follow by dividing its number. Rows that `exclude when` drops are kept as one bit for each row of the
product.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from met.frozen import frozen

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
        after, length, chosen = math.prod(self.lengths[axis + 1 :]), self.lengths[axis], self.chosen[axis]
        place = inner if after == 1 else inner // after
        if axis and any(other > 1 for other in self.lengths[:axis]):
            place = place % length
        return place if chosen is None else chosen[place]
