"""Warnings about macros that the text around their uses takes apart: with `#define STAGE 1 + 4`, `STAGE * 2` is 9."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ic.grammar.syntax import Binary, Entry, Expression, Unary
from ic.meaning.definitions.unused_params import parts
from met.diagnostic import Diagnostic, Expansion, Help, Label

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
