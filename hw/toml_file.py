"""A file in TOML that somebody else may have written: bounded, and each mistake placed at its line."""

from __future__ import annotations

import math
import os
import re
import tomllib
from collections.abc import Sequence
from typing import Any

from met import units
from met.diagnostic import Place, Problem, error
from met.host.files import read_regular
from met.unit_parser import parse_unit

_QUANTITY = re.compile(r"\s*(-?[\d.]+(?:[eE][+-]?\d+)?)\s*(\S.*?)\s*")


def quantity(value: Any, unit: str, *, signed: bool = False) -> float:
    """The number in SI of a text such as "1.5 N*m", of this unit's dimension, finite, and above zero unless it is
    signed. Raises ValueError for other texts."""
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        raise ValueError
    unit_ = parse_unit(match[2])
    try:
        number = float(unit_.to_si(float(match[1]), match[1]))
    except OverflowError as reason:
        raise ValueError from reason
    if not units.same(unit_.dimension, parse_unit(unit).dimension) or not math.isfinite(number):
        raise ValueError
    if number <= 0.0 and not signed:
        raise ValueError
    return number


class TomlFile:
    """A file in TOML, its tables, and the places in it. Making it raises Problem of its code, OSError.

    code   of the errors about the file
    kind, about  the help where the file is no text, and where it is no TOML
    most   bytes that the file may have
    """

    def __init__(self, path: str | os.PathLike[str], *, code: str, most: int, kind: str, about: str) -> None:
        self.name, self.code = os.fspath(path), code
        try:
            self.text = read_regular(path, most).decode("utf-8-sig")
            self.tables: dict[str, Any] = tomllib.loads(self.text)
        except UnicodeDecodeError as reason:
            raise Problem(error(code, f"{self.name} is no text in UTF-8", help=kind)) from reason
        except (tomllib.TOMLDecodeError, RecursionError) as reason:
            line = re.search(r"at line (\d+), column (\d+)", str(reason))
            message = re.sub(r" \(at .*\)$", "", str(reason))
            place = None if line is None else Place(self.name, int(line[1]), int(line[2]), 1)
            wrong = error(code, f"{self.name} is no TOML: {message}", place, help=about)
            raise Problem(wrong, {self.name: self.text}) from reason

    def wrong(
        self, message: str, help: str | Sequence[str], table: str = "", key: str = "", number: int = 0
    ) -> Problem:
        """The error about a table's line, or that of a key of it."""
        return Problem(error(self.code, message, self.place(table, key, number), help=help), {self.name: self.text})

    def place(self, table: str = "", key: str = "", number: int = 0) -> Place:
        """The line of `[table]`, or of the `[[table]]` of this number from 0 on; or that of a key behind it."""
        lines, row = self.text.split("\n"), 0
        head = re.compile(rf"\s*\[{{1,2}}\s*{re.escape(table)}\s*\]")
        heads = [line for line, text in enumerate(lines) if table and head.match(text)]
        if number < len(heads):
            row = heads[number]
        if key:
            named = re.compile(rf"\s*\[*\s*{re.escape(key)}\b")
            row = next((line for line in range(row, len(lines)) if named.match(lines[line])), row)
        text = lines[row]
        column = len(text) - len(text.lstrip()) + 1
        return Place(self.name, row + 1, column, max(1, len(text.rstrip()) - column + 1))
