"""Numbers and tables as text for the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import zip_longest

from met.unit_parser import decimals


def columns(rows: Sequence[Sequence[str]], *, right: Iterable[int] = (), indent: str = "  ") -> list[str]:
    """The rows as lines with aligned columns; those with numbers in `right` are flush right."""
    flush = frozenset(right)
    widths = [max(map(_width, cells)) for cells in zip_longest(*rows, fillvalue="")]
    lines = []
    for row in rows:
        cells = [
            " " * (widths[i] - _width(cell)) + cell if i in flush else cell + " " * (widths[i] - _width(cell))
            for i, cell in enumerate(row)
        ]
        lines.append((indent + "  ".join(cells)).rstrip())
    return lines


def number(value: float) -> str:
    """A computed or measured number to six digits: `0.3`, `1e-05`, `-0` as `0`. (A value of a deck, which someone may
    write again, is `met.unit_parser.written`.)"""
    return f"{value + 0.0:.6g}"


def quantity(value: float, unit: str) -> str:
    """A computed or measured number to six digits, with its unit if it has one."""
    return number(value) if unit in ("1", "") else f"{number(value)} {unit}"


def vector(values: Iterable[float], unit: str, *, computed: bool = False) -> str:
    """SI values as a vector of a unit, in the fewest digits that give the same values again: `[2, 0, 0] m`. computed:
    for the eye alone, in six digits of SI"""
    text = f"[{', '.join(map(number, values) if computed else decimals(values, unit))}]"
    return text if unit in ("1", "") else f"{text} {unit}"


def count(n: int, thing: str, things: str = "") -> str:
    """A number of things: `1 case`, `37 cases`, `1,200 cases`."""
    return f"{n:,} {thing if n == 1 else things or thing + 's'}"


def size(n: int) -> str:
    """A size in bytes, in the units of `met run`: `593 KiB`."""
    value, units = float(n), ["B", "KiB", "MiB", "GiB", "TiB", "PiB"]
    while value >= 1024.0 and len(units) > 1:
        value /= 1024.0
        units.pop(0)
    return f"{value:.0f} {units[0]}" if value >= 100.0 or units[0] == "B" else f"{value:.1f} {units[0]}"


def _width(text: str) -> int:
    """The width of a text in a terminal's columns."""
    if text.isascii():
        return len(text)
    import unicodedata

    sizes = {c: 0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in {*text}}
    return sum(text.count(c) * columns for c, columns in sizes.items())
