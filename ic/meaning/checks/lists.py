"""Warnings about lists whose elements loops take, `for i in 1 .. 2` over `lengths[i]`, and pass over the first."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence

from ic.grammar.syntax import Entry, Indexed, Let, List, Name, Number, WithUnit, place_of
from ic.meaning.definitions.unused_params import parts
from ic.meaning.expressions.evaluate import evaluate_number
from ic.meaning.expressions.quantity import Value
from met.diagnostic import Diagnostic, Help, Label, Problem
from met.messages.message import shown_place


def skipped_elements(entries: Sequence[Entry]) -> Iterator[Diagnostic]:
    """Warn about the first element of a list of this file that loops take from its second on (D388)."""
    lists = {let.name.text: let for let in entries if isinstance(let, Let) and not shown_place(let.place).included}
    taken = defaultdict[str, list[Indexed]](list)
    named = Counter[str]()
    for part in parts(entries) if lists else ():
        if isinstance(part, Indexed):
            taken[part.name.text].append(part)
        elif isinstance(part, Name):
            named[part.path[0].text] += 1
    for name, elements in taken.items():
        written = lists[name].value if name in lists else None
        items = written.inner if isinstance(written, WithUnit) else written
        indices = {_index(element) for element in elements}
        if not isinstance(items, List) or len(indices) < 2 or indices & {None, 0} or named[name] > len(elements):
            continue
        first = items.items[0]
        if not (isinstance(first, Number) and first.value == 0.0):  # a filler, so that counts begin at 1
            message = f"nothing takes `{name}[0]`, the first element of a list that loops take element by element"
            also = Label(elements[0].place, "taken here")
            helps = f"elements count from 0: is the index to be one less, as in `{name}[i - 1]`?"
            yield Diagnostic("D388", message, Label(place_of(first)), (also,), (Help(helps),), severity="warning")


def _index(taken: Indexed) -> int | None:
    """The index that an iteration of a loop takes; None where it is not one that numbers alone make."""
    if not any(expansion.iteration for expansion in taken.place.expansions):
        return None
    try:
        return int(evaluate_number(taken.index, _no_name).number)
    except Problem:
        return None


def _no_name(name: Name) -> Value:
    raise Problem(())
