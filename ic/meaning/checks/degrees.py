"""Sines and cosines of bare numbers that look like degrees."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from ic.grammar.spell import spell
from ic.grammar.syntax import Call, Deck, Entry, Expression, Group, Number, children, place_of
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value
from ic.text.complaints import Complaints
from met.diagnostic import Problem, write
from met.trace import Scalar


def remark_degrees(deck: Deck, definitions: Definitions, complaints: Complaints) -> None:
    """Report `sin(90)`: more than a turn in radians, without pi in the expression."""
    if not any("sin(" in text or "cos(" in text for text in (source.text.replace(" ", "") for source in deck.sources)):
        return
    names = Names(definitions, {})
    for call in _calls(deck.entries):
        if call.name.text not in ("sin", "cos") or len(call.positional) != 1:
            continue
        argument = call.positional[0]
        try:
            angle = names.evaluate(argument)
        except Problem:
            continue  # reported where the value is used
        if not isinstance(angle, Value) or not angle.bare or angle.hertz is None:
            continue
        if isinstance(angle.number, Scalar) or abs(angle.number) <= 2.0 * math.pi:
            continue
        plain = isinstance(argument, Number)
        written = spell(argument) if plain else f"({spell(argument)})"
        complaints.warn(
            "D306",
            f"`{call.name.text}` of {angle.number:g}, a bare number: these are radians",
            place_of(argument),
            help=[
                write(
                    f"{written} deg", f"if degrees are meant, write `{call.name.text}({written} deg)`", where="value"
                ),
                write(
                    f"{written} rad", f"if radians are meant, write `{call.name.text}({written} rad)`", where="value"
                ),
            ],
        )


def _calls(entries: Iterable[Entry]) -> Iterator[Call]:
    """Every call in the entries' values, those of blocks inside them too."""
    waiting: list[Entry] = list(entries)
    while waiting:
        entry = waiting.pop()
        if isinstance(entry, Group):
            waiting += [*entry.body, *(getattr(entry.made_from, "body", None) or ())]
            continue
        value = getattr(entry, "value", None)
        stack: list[Expression] = [value] if value is not None else []
        while stack:
            part = stack.pop()
            if isinstance(part, Call):
                waiting += part.body or ()
                yield part
            stack += children(part)
