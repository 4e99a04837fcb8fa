"""Reading and writing of units in the form of declarations, plans and command lines: `V*s/rad`, by recursive
descent."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import lru_cache
from types import MappingProxyType

from met.units import ALL_UNITS, ONE, Measure

BIGGEST_EXPONENT = 9


def parse_unit(written: str, names: Mapping[str, Measure] = MappingProxyType({})) -> Measure:
    """The meaning of a unit as a model's declaration writes it: `V*s/rad`, `N*m/(rad*s)`, `m^2`, `1/s`, `1`.

    names: further words with their meanings here, such as `joint`. ValueError where it cannot be read: a declaration is
    a programmer's text (a deck's units are read by ic).
    """
    return _UnitReader(written, names).whole()


_PIECE = re.compile(r"\s*(?:(%|[A-Za-z_]+)|(-?\d+)|([*/^()]))")


class _UnitReader:
    """Recursive descent over a declaration's unit."""

    def __init__(self, written: str, names: Mapping[str, Measure]) -> None:
        self.written = written
        self.names = names
        self.pieces: list[str] = []
        start = 0
        while written[start:].strip():
            match = _PIECE.match(written, start)
            if match is None:
                raise ValueError(f"unit `{written}`: cannot read `{written[start:].strip()}`")
            self.pieces.append(match.group().strip())
            start = match.end()
        self.position = 0

    def whole(self) -> Measure:
        """The measure of the whole text. Raises ValueError."""
        result = self.product()
        if self.position < len(self.pieces):
            raise ValueError(f"unit `{self.written}`: cannot read `{self.pieces[self.position]}`")
        return result

    def take(self) -> str:
        if self.position >= len(self.pieces):
            raise ValueError(f"unit `{self.written}` ends too early")
        self.position += 1
        return self.pieces[self.position - 1]

    def next_is(self, *wanted: str) -> bool:
        return self.position < len(self.pieces) and self.pieces[self.position] in wanted

    def product(self) -> Measure:
        """The measure of factors joined by `*` and `/`. Raises ValueError."""
        result = self.factor()
        while self.next_is("*", "/"):
            sign = 1 if self.take() == "*" else -1
            result = result * self.factor() ** sign
        return result

    def factor(self) -> Measure:
        """One factor of a unit, a name or brackets, with its exponent. Raises ValueError."""
        piece = self.take()
        if piece == "(":
            result = self.product()
            if self.take() != ")":
                raise ValueError(f"unit `{self.written}`: `)` is missing")
        elif piece == "1":
            result = ONE
        elif piece in self.names:
            result = self.names[piece]
        elif piece in ALL_UNITS:
            result = ALL_UNITS[piece].measure
        else:
            from met.messages.other_units import suggest  # for a message only

            near = suggest(piece)
            raise ValueError(f"unit `{self.written}`: `{piece}` is not a unit" + (f"; `{near}`?" if near else ""))
        if self.next_is("^"):
            self.take()
            exponent = self.take()
            if not exponent.lstrip("-").isdigit() or abs(int(exponent)) > BIGGEST_EXPONENT:
                raise ValueError(f"unit `{self.written}`: `{exponent}` is not a small whole exponent")
            result = result ** int(exponent)
        return result


def written(si: float, unit: str) -> str:
    """An SI value in a unit, in the fewest digits that give the same value again: `0.33 V*s/rad`."""
    [text] = decimals([si], unit)
    return text if unit in ("", "1") else f"{text} {unit}"


def decimals(values: Iterable[float], unit: str) -> list[str]:
    """SI values as numbers of a unit, each in the fewest digits that give the same value again; of an unreadable unit,
    which MET never writes, in SI."""
    measure = _readable(unit)
    return [measure.decimal(float(value)) for value in values]


@lru_cache
def _readable(unit: str) -> Measure:
    try:
        return parse_unit(unit or "1")
    except ValueError:
        return ONE
