"""Remedies for a value of the wrong dimension; and the expressions of a list's numbers."""

from __future__ import annotations

import math
from dataclasses import replace

from ic.grammar.syntax import Expression, List, Number, WithUnit
from ic.language.unit_words import in_degrees, units_of
from ic.meaning.definitions.merge import Item
from ic.meaning.expressions.quantity import Value
from met.diagnostic import Help, write
from met.trace import Scalar
from met.units import ONE, PURE, Dimension


def components(item: Item | None, count: int) -> tuple[Expression | None, ...]:
    """The expressions of a list's `count` numbers; None for each where the item writes no such list."""
    written = item.value if item is not None and not item.appended else None
    unit = written.unit if isinstance(written, WithUnit) else None
    listed = written.inner if isinstance(written, WithUnit) else written
    if not isinstance(listed, List):
        return (None,) * count
    parts: list[Expression | None] = []
    for part in listed.items:
        if unit is not None:
            part = replace(part, unit=unit) if isinstance(part, Number) else WithUnit(part, unit, part.place)
        parts.append(part)
    return (*parts, *[None] * (count - len(parts)))


def unit_remedy(value: Value, text: str, dimension: Dimension) -> Help:
    """The remedy where a value has the wrong dimension."""
    number = None if isinstance(value.number, Scalar) else float(value.number)
    if dimension == PURE:
        return Help("leave the unit out; `%` is the only unit of a pure number")
    if value.dimension == Dimension(s=-1) and dimension == Dimension(s=-1, rad=1):
        return Help("Hz counts cycles without an angle: write rad/s, deg/s, rpm or cycle/s")
    if value.dimension == Dimension(s=-1, rad=1) and dimension == Dimension(s=-1):
        if text == "Hz":
            why = "a frequency counts cycles, without an angle"
            hertz = "" if number is None else f"{ONE.decimal(number / (2.0 * math.pi))} Hz"
            return write(hertz, f"{why}: write `{hertz}`", where="value") if hertz else Help(why)
        if number is None:
            return Help(f"leave the angle out: write `... {text}`")
        same = f"{ONE.decimal(number)} {text}"
        return write(same, f"leave the angle out: write `{same}`", where="value")
    known = list(dict.fromkeys((text, *sorted(in_degrees(text)), *units_of(dimension))))
    return Help(f"write it in {', '.join(known[:-1])} or {known[-1]}" if len(known) > 1 else f"write it in {known[0]}")
