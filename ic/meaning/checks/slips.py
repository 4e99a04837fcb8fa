"""Warnings about slips of writing: sines of degrees, elements of lists in loops, and macros taken apart."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence

from ic.grammar.syntax import (
    Binary,
    Call,
    Deck,
    Entry,
    Expression,
    Group,
    Indexed,
    Let,
    List,
    Name,
    Number,
    Unary,
    WithUnit,
    children,
    place_of,
    spell,
)
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.definitions.unused_params import parts
from ic.meaning.expressions.evaluate import evaluate_number
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value
from ic.text.complaints import Complaints
from met.diagnostic import Diagnostic, Expansion, Help, Label, Problem, write
from met.messages.message import shown_place
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


ALIKE = {("+", "+"), ("+", "-"), ("*", "*"), ("*", "/"), ("-", "*"), ("-", "/")}
"""An operator before a macro's use, and one of its own, that give the same in either order; `-` is then a sign."""


def macros_taken_apart(entries: Sequence[Entry]) -> Iterator[Diagnostic]:
    """Warn about each macro of whose operators one takes an operand that reaches beyond the macro (D389)."""
    by_macro: dict[str, Diagnostic] = {}
    for node in parts(entries):  # the last come first
        is_taken = isinstance(node, Unary) or (isinstance(node, Binary) and node.operator in "+-*/")
        for expansion in node.place.expansions if is_taken else ():
            by, name = _beyond(node, expansion), expansion.macro
            if by and not expansion.iteration:
                part_of, cure = "", f"put its value in brackets: `#define {name} (...)`"
                if _is_argument(node, expansion):
                    part_of, cure = (
                        "an argument of ",
                        f"put the parameters of `{name}` in brackets where its value has them",
                    )
                message = (
                    f"`{by}` takes a part of {part_of}macro `{name}` alone: it binds before the `{node.operator}` in it"
                )
                by_macro[name] = Diagnostic(
                    "D389", message, Label(expansion.use), (), (Help(cure),), severity="warning"
                )
    yield from by_macro.values()


def _beyond(node: Binary | Unary, expansion: Expansion) -> str:
    """The operator outside of an expansion, or of a macro's argument, that an operand of one inside has taken; "" where
    there is none, or where it makes no difference."""
    if isinstance(node, Unary):
        return "^" if _outside(node.operand, expansion) == "^" else ""
    if _is_argument(node, expansion):
        left, right = (_of_value(operand, expansion) for operand in (node.left, node.right))
        return right or ("" if (left, node.operator) in ALIKE else left)
    left, right = (_outside(operand, expansion) for operand in (node.left, node.right))
    return right or ("" if (left, node.operator) in ALIKE else left)


def _outside(operand: Expression, expansion: Expansion) -> str:
    """The operator of an operation that is written outside of an expansion; "" of anything else."""
    if isinstance(operand, Binary | Unary) and expansion not in operand.place.expansions:
        return operand.operator
    return ""


def _is_argument(node: Binary | Unary, expansion: Expansion) -> bool:
    """True of an operation in an argument of a macro: it is written where the macro is used."""
    use = expansion.use
    return expansion in node.place.expansions and (node.place.file, node.place.line) == (use.file, use.line)


def _of_value(operand: Expression, expansion: Expansion) -> str:
    """The operator of an operation that is written in a macro's value; "" of anything else."""
    if not isinstance(operand, Binary | Unary) or _is_argument(operand, expansion):
        return ""
    return operand.operator if expansion in operand.place.expansions else ""
