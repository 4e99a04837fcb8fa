"""Expressions as text again, for messages and for a plan's quotes of its deck."""

from __future__ import annotations

from ic.grammar.syntax import (
    Binary,
    Broken,
    Call,
    Entry,
    Expression,
    Group,
    Indexed,
    Let,
    List,
    Name,
    Number,
    OverCases,
    Range,
    Setting,
    String,
    Unary,
    WithUnit,
)

LOOSE = {"or": 1, "and": 2, "<": 3, "<=": 3, ">": 3, ">=": 3, "==": 3, "!=": 3, "+": 4, "-": 4, "*": 5, "/": 5, "^": 7}


def spell(expression: Expression, within: int = 0) -> str:
    """The expression in a deck's syntax. within: the binding strength of the surrounding operator"""
    match expression:
        case Number():
            if expression.unit is None:
                return expression.text
            gap = "" if expression.text.endswith(expression.unit.text) else f" {expression.unit.text}"
            return expression.text + gap
        case String():
            return f'"{expression.value}"'
        case Name():
            return expression.text
        case Indexed():
            return f"{expression.name.text}[{spell(expression.index)}]"
        case List():
            return "[" + ", ".join(spell(item) for item in expression.items) + "]"
        case WithUnit():
            inner = spell(expression.inner)
            closed = isinstance(expression.inner, (List, Call))
            return f"{inner if closed else f'({inner})'} {expression.unit.text}"
        case Call():
            named = (f"{word.text} = {spell(value)}" for word, value in expression.named)
            inside = ", ".join([*(spell(value) for value in expression.positional), *named])
            head = expression.name.text + (f"({inside})" if inside or expression.body is None else "")
            return head if expression.body is None else f"{head} {_body(expression.body)}"
        case OverCases():
            share = f" in {spell(expression.share)} of cases" if expression.share is not None else ""
            confidence = f" with {spell(expression.confidence)} confidence" if expression.confidence is not None else ""
            return f"{spell(expression.comparison)}{share}{confidence}"
        case Broken():
            return "..."
        case Range():
            return f"{spell(expression.first)} .. {spell(expression.last)} by {spell(expression.step)}"
        case Unary():
            gap = " " if expression.operator == "not" else ""
            return f"{expression.operator}{gap}{spell(expression.operand, 6)}"
        case Binary():
            binds = LOOSE[expression.operator]
            text = f"{spell(expression.left, binds)} {expression.operator} {spell(expression.right, binds + 1)}"
            return f"({text})" if binds < within else text
    raise AssertionError(expression)


def _body(entries: tuple[Entry, ...]) -> str:
    """A block's entries with its braces, in one line."""
    return " ".join(["{", *map(_entry, entries), "}"])


def _entry(entry: Entry) -> str:
    """An entry as the text of a deck."""
    if isinstance(entry, Setting):
        name = ".".join(word.text for word in entry.path)
        return " ".join([*(word.text for word in entry.words), name, entry.operator, f"{spell(entry.value)};"])
    if isinstance(entry, Group):
        return " ".join([*(word.text for word in entry.words), _body(entry.body)])
    if isinstance(entry, Let):
        return f"{'param' if entry.is_param else 'let'} {entry.name.text} = {spell(entry.value)};"
    named = [f"{entry.name.text}:"] if entry.name is not None else []
    return " ".join([*(word.text for word in entry.words), *named, f"{spell(entry.value)};"])
