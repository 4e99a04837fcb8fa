"""Recipes of computed columns of a case table, as plain JSON data, with arrays kept elsewhere.

    {"axis": 0, "of": {"sizes": [1000, 10000, 1], "chosen": [...], "kept": ...}, "values": ...}     a coordinate
    {"seed": 0, "path": "gearbox.kp", "sample": 1, "count": ..., "distribution": "uniform", ...}    its draws
    {"first": 0, "count": ...}                                                                      whole numbers
    {"positions": {...}, "among": ...}, {"shifted": {...}, "by": ...}                               positions of groups

Data from a file is checked here, so that a column that was read gives a number for each of its rows.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from met.plan import columns, drawing
from met.plan.columns import MOST_SWEPT, CaseValues, ComputedColumn, RowBits, SweptRows

Keep = Callable[[np.ndarray], Any]
"""A function that stores an array elsewhere, and returns its place as JSON data."""

Find = Callable[[Any], np.ndarray]
"""A function that returns an array from its place. Raises ValueError and the like where it is not there."""


class ArrayKeeper:
    """Storage that keeps each array once, by a function of its number and the array that returns its place."""

    def __init__(self, put: Callable[[int, np.ndarray], Any]) -> None:
        self._put, self._stored = put, list[tuple[np.ndarray, Any]]()

    def keep(self, array: np.ndarray) -> Any:
        """The reference to an array, which is stored at the first call."""
        for known, where in self._stored:
            if known is array:
                return where
        where = self._put(len(self._stored), array)
        self._stored.append((array, where))
        return where


MOST_AXES = 10_000
MOST_ROWS = 10 * MOST_SWEPT
"""Largest number of rows of a product that is read, of which a sweep keeps fewer; a column has as many as a sweep."""


def encoded(column: CaseValues, keep: Keep) -> Any:
    """A column as JSON data. An array is stored elsewhere, unless it is short."""
    match column:
        case np.ndarray():
            return column.tolist() if len(column) <= columns.LISTED_ROWS and np.isfinite(column).all() else keep(column)
        case columns.AxisColumn():
            return {"axis": column.axis, "of": _rows(column.rows, keep), "values": encoded(column.values, keep)}
        case columns.CountedRows():
            return {"first": column.first, "count": column.size}
        case columns.PositionColumn():
            among = column.among and {"bits": keep(column.among.packed), "count": column.among.count}
            return {"positions": _rows(column.rows, keep), "among": among}
        case columns.ShiftedColumn():
            return {"shifted": encoded(column.values, keep), "by": column.by, "whole": column.dtype == np.int64}
        case drawing.DrawnColumn():
            return {
                "seed": column.seed,
                "path": column.path,
                "sample": column.number,
                "count": column.size,
                "distribution": column.distribution,
                "arguments": list(column.arguments),
                "unit": column.unit,
            }
    raise TypeError(column)


def _rows(rows: SweptRows, keep: Keep) -> dict[str, Any]:
    chosen = [None if places is None else places.tolist() for places in rows.chosen]
    return {"sizes": list(rows.sizes), "chosen": chosen, "kept": rows.kept and keep(rows.kept.packed)}


class RecipeReader:
    """Reader of recipes; columns of one table share their rows, and arrays are found once.

    find  gives what `Keep` kept
    """

    def __init__(self, find: Find) -> None:
        self._find, self._rows_read = find, dict[str, SweptRows]()

    def column(self, data: Mapping[str, Any]) -> CaseValues:
        """The column of a recipe. Raises ValueError, LookupError or TypeError for invalid data."""
        if "file" in data:
            return self._values(data)
        if "axis" in data:
            rows, axis, values = self._rows(data["of"]), _whole(data["axis"]), self._values(data["values"])
            if axis >= len(rows.sizes) or len(values) != rows.sizes[axis]:
                raise ValueError("an axis has other values than its table says")
            return columns.AxisColumn(rows, axis, values)
        if "first" in data:
            return columns.CountedRows(_whole(data["count"]), _whole(data["first"]))
        if "positions" in data:
            rows, among = self._rows(data["positions"]), data["among"]
            product = math.prod(rows.sizes)
            if among is None:
                return columns.PositionColumn(rows, None)
            if not isinstance(among, Mapping) or among["count"] != product:
                raise ValueError("rows are among others than there are")
            return columns.PositionColumn(rows, self._bits(among["bits"], product, product))
        if "shifted" in data:
            dtype = np.int64 if data["whole"] is True else np.float64
            return columns.ShiftedColumn(self._values(data["shifted"]), _whole(data["by"]), dtype)
        return self._drawn(data)

    def _drawn(self, data: Mapping[str, Any]) -> ComputedColumn:
        """A column of values drawn from a distribution, from its JSON. Raises ValueError."""
        arguments, name = tuple(map(_number, data["arguments"])), _word(data["distribution"])
        if name not in drawing.QUANTILES or len(arguments) != drawing.ARGUMENTS[name]:
            raise ValueError("there is no such distribution")
        if not all(map(math.isfinite, arguments)) or not drawing.is_sound(name, arguments):
            raise ValueError("there is no such distribution")
        count, seed = _whole(data["count"], most=MOST_SWEPT), _whole(data["seed"], most=2**53)
        sample = _whole(data["sample"])
        return drawing.DrawnColumn(count, seed, _word(data["path"]), sample, name, arguments, _word(data["unit"]))

    def _values(self, data: Any) -> CaseValues:
        """The values of an axis from JSON: numbers, an array kept elsewhere, or another column. Raises ValueError."""
        if isinstance(data, Mapping):
            if data.keys() & {"axis", "first", "positions", "shifted", "seed"}:
                return self.column(data)
            column = self._find(data)
            if column.ndim != 1:
                raise ValueError("an axis is a row of numbers")
            return np.asarray(column, dtype=float)
        return np.array([_number(number) for number in data], dtype=float)

    def _rows(self, data: Mapping[str, Any]) -> SweptRows:
        """The rows of a case table from a plan's data; of equal data the same object."""
        known = json.dumps(data, sort_keys=True)
        if known not in self._rows_read:
            self._rows_read[known] = self._new_rows(data)
        return self._rows_read[known]

    def _new_rows(self, data: Mapping[str, Any]) -> SweptRows:
        """The rows of the product of a sweep's axes that its table has, from JSON. Raises ValueError."""
        sizes = tuple(_whole(size, least=1) for size in data["sizes"])
        if len(sizes) > MOST_AXES or math.prod(sizes) > MOST_ROWS or len(data["chosen"]) != len(sizes):
            raise ValueError("a table has more rows than any")
        chosen = []
        for places, size in zip(data["chosen"], sizes, strict=True):
            array = None if places is None else np.array([_whole(place) for place in places], np.int64)
            if array is not None and not (len(array) and (np.diff(array) > 0).all() and array[-1] < size):
                raise ValueError("an axis has no such values")
            chosen.append(array)
        rows = SweptRows(sizes, tuple(chosen))
        if data["kept"] is None:
            return rows
        return rows.only(self._bits(data["kept"], rows.product, rows.product))

    def _bits(self, data: Any, most: int, count: int) -> RowBits:
        """The rows of a table that count, from packed bits. Raises ValueError where they are not as many as its
        rows."""
        if not isinstance(data, Mapping):
            raise ValueError("bits of a table are kept elsewhere")
        packed = self._find(data)
        if count > most or packed.dtype != np.uint8 or packed.ndim != 1 or len(packed) != -(-count // 8):
            raise ValueError("the bits of a table are not as many as its rows")
        return RowBits(packed, count)


def _whole(data: Any, least: int = 0, most: int = MOST_ROWS) -> int:
    if type(data) is not int or not least <= data <= most:
        raise ValueError("a whole number is needed")
    return data


def _number(data: Any) -> float:
    if type(data) not in (int, float):
        raise ValueError("a number is needed")
    return float(data)


def _word(data: Any) -> str:
    if not isinstance(data, str):
        raise TypeError("a word is needed")
    return data
