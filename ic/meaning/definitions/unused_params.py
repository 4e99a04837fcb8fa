"""Warnings about what nothing uses: a `param` that was meant for one of another file, `param raech = 0.9 m;` above an
include; the first of a list, `for i in 1 .. 2` over `lengths[i]`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from ic.grammar.syntax import Entry, Let, Name, Setting
from met.diagnostic import Diagnostic, Label, Place, write
from met.messages.message import meant, shown_place


def misspelt_params(entries: Sequence[Entry]) -> Iterator[Diagnostic]:
    """Warn about each `param` that nothing names, where an included file has one of nearly the same name (D386)."""
    params = [entry for entry in entries if isinstance(entry, Let) and entry.is_param]
    near: dict[str, tuple[Let, Let]] = {}
    for let in params:
        others = {other.name.text: other for other in params if _is_included(other, shown_place(let.place).file)}
        near_name = None if let.name.text in others else meant(let.name.text, others)
        if near_name is not None:
            near[let.name.text] = let, others[near_name]
    named = _named(entries) if near else set()
    for name, (let, other) in near.items():
        if name not in named:
            text = other.name.text
            message = f"nothing uses `{name}`, so it has no effect"
            also = Label(other.name.place, f"`{text}`, which an including deck may set")
            helps = write(text, f"did you mean `{text}`?")
            yield Diagnostic("D386", message, Label(let.name.place), (also,), (helps,), severity="warning")


def _is_included(let: Let, by: str) -> bool:
    return any(file == by for file, _ in shown_place(let.place).included)


def _named(entries: Iterable[Entry]) -> set[str]:
    """The first words of all paths that a deck's entries name or set."""
    return {part.path[0].text for part in parts(entries) if isinstance(part, Name | Setting) and part.path}


def parts(entries: Iterable[Entry]) -> Iterator[Any]:
    """All parts of these entries, of every depth."""
    waiting: list[Any] = list(entries)
    while waiting:
        part = waiting.pop()
        yield part
        if isinstance(part, list | tuple):
            waiting += part
        elif is_dataclass(part) and not isinstance(part, Place):
            waiting += (getattr(part, field.name) for field in fields(part))
