"""Remedies for a value of the wrong dimension; and the expressions of a list's numbers."""

from __future__ import annotations

import math
from dataclasses import replace

from ic.grammar.syntax import Expression, List, Number, WithUnit
from ic.language.unit_words import in_degrees, units_of
from ic.meaning.definitions.merge import Item
from ic.meaning.expressions.quantity import Value
from met.trace import Scalar
from met.units import PURE, Dimension


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


def unit_remedy(value: Value, text: str, dimension: Dimension) -> str:
    """The remedy where a value has the wrong dimension."""
    number = None if isinstance(value.number, Scalar) else float(value.number)
    if dimension == PURE:
        return "leave the unit out; `%` is the only unit of a pure number"
    if value.dimension == Dimension(s=-1) and dimension == Dimension(s=-1, rad=1):
        return "Hz counts cycles without an angle: write rad/s, deg/s, rpm or cycle/s"
    if value.dimension == Dimension(s=-1, rad=1) and dimension == Dimension(s=-1):
        if text == "Hz":
            shown = "" if number is None else f": write `{number / (2.0 * math.pi):g} Hz`"
            return f"a frequency counts cycles, without an angle{shown}"
        return f"leave the angle out: write `{'...' if number is None else f'{number:g}'} {text}`"
    known = list(dict.fromkeys((text, *sorted(in_degrees(text)), *units_of(dimension))))
    return f"write it in {', '.join(known[:-1])} or {known[-1]}" if len(known) > 1 else f"write it in {known[0]}"
