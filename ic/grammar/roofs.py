"""Definitions under a roof: the names of a deck that another one brings in by `use <panda.ic> as panda;`.

A definition of a used deck is called by its full name, `panda.drive`, which is one word here. In the deck that uses it
`panda.drive.kp` is a path of two words. In the used deck itself names are written without the roof, and each notes it:
its meaning is decided where it is looked up, since only there it is known to be the name of a value.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import replace

from ic.grammar.syntax import (
    Call,
    Entry,
    Expression,
    Group,
    Indexed,
    Let,
    Name,
    Setting,
    Statement,
    Word,
    mapped,
    spanned,
)


def full_words(path: tuple[Word, ...], roofs: Collection[str]) -> tuple[Word, ...]:
    """The words of a path, the first of which is the full name where the path begins with a roof."""
    if not path or path[0].text not in roofs:
        return path
    name, count = path[0].text, 1
    while count < len(path) and name in roofs:
        name, count = f"{name}.{path[count].text}", count + 1
    if count == 1:
        return path
    return (Word(name, spanned(path[0].place, path[count - 1].place)), *path[count:])


def split_path(path: str, roofs: Collection[str]) -> list[str]:
    """The words of a path as text, the first of which is the full name where the path begins with a roof."""
    first, *rest = path.split(".")
    while rest and first in roofs:
        first = f"{first}.{rest.pop(0)}"
    return [first, *rest]


def with_full_names(entries: Iterable[Entry], roofs: Collection[str]) -> tuple[Entry, ...]:
    """The entries of a deck in which every path that begins with one of its roofs begins with a full name."""

    def path(words: tuple[Word, ...]) -> tuple[Word, ...]:
        return full_words(words, roofs)

    def name(written: Name) -> Name:
        return replace(written, path=path(written.path))

    return tuple(_changed(entry, name, path) if roofs else entry for entry in entries)


def under_roof(entries: Iterable[Entry], roof: str, left: Collection[str]) -> tuple[tuple[Entry, ...], dict[str, str]]:
    """The entries of a used deck with full names, and the kinds of the omitted ones, by name.

    left  kinds of definitions that stay away
    """
    renamed: list[Entry] = []
    stayed: dict[str, str] = {}

    def within(name: Name) -> Name:
        return replace(name, roof=f"{roof}.{name.roof}" if name.roof else roof)

    for entry in entries:
        words = list(getattr(entry, "words", ()))
        kinds = [word.text for word in words if word.text != "default"] or [""]
        if kinds[0] in left:
            name = entry.path[-1] if isinstance(entry, Setting) else words[-1]
            stayed.setdefault(name.text, kinds[0])
            continue
        entry = _changed(entry, within, tuple)
        if isinstance(entry, Let):
            renamed.append(replace(entry, name=_full(entry.name, roof)))
        elif isinstance(entry, Group) and len(words) > 1:
            index = 2 if words[0].text == "default" and len(words) > 2 else 1
            words[index] = _full(words[index], roof)
            like = entry.like
            if like is not None:
                like = replace(like, path=(_full(like.path[0], roof), *like.path[1:]), roof="")
            renamed.append(replace(entry, words=tuple(words), like=like))
        else:
            renamed.append(entry)
    return tuple(renamed), stayed


def _full(word: Word, roof: str) -> Word:
    return Word(f"{roof}.{word.text}", word.place)


def _changed(entry: Entry, name: Callable[[Name], Name], path: Callable[[tuple[Word, ...]], tuple[Word, ...]]) -> Entry:
    """The entry with its names and the paths that it sets changed."""

    def value(expression: Expression) -> Expression:
        match expression:
            case Name():
                return name(expression)
            case Indexed():
                return replace(expression, name=name(expression.name), index=value(expression.index))
            case Call(body=body):
                changed = mapped(expression, value)
                assert isinstance(changed, Call)
                inside = None if body is None else tuple(block(body))
                return replace(changed, name=name(expression.name), body=inside)
        return mapped(expression, value)

    def block(entries: Iterable[Entry]) -> Iterator[Entry]:
        return (_changed(inner, name, path) for inner in entries)

    match entry:
        case Let() | Statement():
            return replace(entry, value=value(entry.value))
        case Setting():
            return replace(entry, path=path(entry.path), value=value(entry.value))
    like, of = (None if base is None else name(base) for base in (entry.like, entry.of))
    made_from = None if entry.made_from is None else value(entry.made_from)
    assert made_from is None or isinstance(made_from, Call)
    return replace(entry, like=like, of=of, body=tuple(block(entry.body)), made_from=made_from)
