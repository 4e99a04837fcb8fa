"""Entries at the top of a deck: `deck 2;`, `unit NAME = SIZE;`, and `use <panda.ic> as panda;`.

A definition of a used deck is called by its full name, `panda.drive`, which is one word here. In the deck that uses it
`panda.drive.kp` is a path of two words. In the used deck itself names are written without the roof, and each notes it:
its meaning is decided where it is looked up, since only there it is known to be the name of a value.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import NoReturn

from ic.grammar.cursor import Unreadable, span, token_in_words
from ic.grammar.declared_units import UNIT, USAGE, declarations, is_declaration, measures
from ic.grammar.loops import Loops
from ic.grammar.syntax import (
    Broken,
    Call,
    Entry,
    Expression,
    Group,
    Indexed,
    Let,
    Name,
    Setting,
    Statement,
    UseEntry,
    Word,
    mapped,
    spanned,
)
from ic.text.edition import EDITION_WORD, EDITIONS
from ic.text.lexer import NAME, STRING, Token
from ic.text.limits import Findings
from met.diagnostic import Label, leave_out
from met.units import ONE

USE, AS = "use", "as"
USE_USAGE = 'write `use <panda.ic> as panda;` or `use "beside.ic" as beside;`'


class Uses(Loops):
    """The part of the parser for the edition of a file, the units that a deck declares, and the decks that it uses."""

    def __init__(self, tokens: Sequence[Token], findings: Findings) -> None:
        super().__init__(tokens, findings)
        self.uses: list[UseEntry] = []
        self.refused_units: set[str] = set()  # files of edition 1 that declare units, which has been reported

    def declare_units(self) -> None:
        """Find the units that the deck declares anywhere, before it is parsed."""
        self.take_misplaced_editions()
        self.unsized.update(
            self.tokens[position + 1].text
            for position, token in enumerate(self.tokens)
            if token.text == UNIT and token.source.edition == 1 and is_declaration(self.tokens, position)
        )
        positions = declarations(self.tokens)
        if not positions:
            return
        self.declared = {**self.declared, **dict.fromkeys(positions, ONE)}
        sizes: dict[str, tuple[Token, Expression]] = {}
        self.units_alone = True
        for name, position in positions.items():
            self.position = position + 2
            with suppress(Unreadable):
                sizes[name] = (self.tokens[position], self.value())
            self.operators, self.peak = 0, 0
            self.open.clear()
        known = measures(sizes, self.findings)
        self.declared = {**self.declared, **known}
        self.unsized.update(positions.keys() - known.keys())
        self.position, self.units_alone = 0, False

    def take_misplaced_editions(self) -> None:
        """Read a file with a misplaced `deck 2;`, which is reported, in that edition: the rest may be right."""
        for word, number in pairwise(self.tokens):
            if word.text == EDITION_WORD and word.source.heading is None and number.text in map(str, EDITIONS):
                word.source.edition = int(number.text)

    def step_over_unit(self) -> None:
        """Step over `unit NAME = SIZE;`, which has been read, and refuse it where it is not allowed."""
        start, depth = self.position, len(self.open)
        word, name = self.tokens[start : start + 2]
        try:
            if word.source.edition == 1:
                help = self.as_edition_2(word, "a file of edition 2 declares units")
                if word.source.name in self.refused_units:  # once for each file
                    raise Unreadable
                self.refused_units.add(word.source.name)
                self.fail("D394", "edition 1 declares no units", span(word, name), help=help)
            if self.depth or depth:
                self.fail("D394", "a unit is declared outside of blocks and loops", span(word, name), help=USAGE)
            first = declarations(self.tokens)[name.text]
            if first != start + 1:
                also = (Label(self.tokens[first].place, "the first"),)
                self.fail("D394", f"unit `{name.text}` is declared twice", name, also=also, help="leave one out")
            self.position += 3
            self.units_alone = True
            self.semicolon(self.value())
        except Unreadable:
            self.recover(start, depth)
        self.units_alone = False

    def not_the_edition(self, word: Token) -> NoReturn:
        """Report a `deck 2;` that does not set the edition, at its number."""
        number = self.token
        heading = word.source.heading
        edition_entry = f"{word.text} {number.text};"
        if heading is not None:
            place = word.source.place(heading.first, heading.last - heading.first)
            label = Label(place, "it is said here")
            help = leave_out("leave one of the two out", word.place)
            self.fail("D391", "a file says its edition once", span(word, number), also=(label,), help=help)
        known = " or ".join(f"`{EDITION_WORD} {edition};`" for edition in EDITIONS)
        if number.text not in map(str, EDITIONS) or self.following.text != ";":
            self.fail("D391", "this is no edition", span(word, number), help=f"write {known} in the file's first line")
        message = "a file says its edition before all else but comments"
        self.fail("D391", message, span(word, number), help=f"make `{edition_entry}` the first line of the file")

    def at_use(self) -> bool:
        """Return True if a deck is used here, or text that was meant for that."""
        if self.token.text != USE:
            return False
        if self.following.text == "<" or self.following.kind == STRING:
            return True
        position = self.position + 1  # `use panda.ic as panda;`
        while self.tokens[position].kind == NAME or self.tokens[position].text in (".", "/", "-"):
            if self.tokens[position].text == AS and position > self.position + 1:
                return True
            position += 1
        return False

    def use(self) -> None:
        """Read an entry `use FILE as NAME;`, and append it to `uses`. Raises Unreadable where it is none (D395)."""
        word = self.advance()
        if self.depth or self.open:
            self.fail("D395", "a deck is used outside of blocks and loops", word, help="move this entry out")
        if self.token.kind != STRING and self.token.text != "<":
            self.fail("D395", f"expected a file, found {token_in_words(self.token)}", self.token, help=USE_USAGE)
        first = self.token
        name = first.text[1:-1]
        place = first.place
        if first.text == "<":
            written = first.source.rest_of_line(first.offset)
            end = written.find(">")
            if end < 0:
                self.fail("D395", "`use <` without its `>`", first, help=USE_USAGE)
            name, place = written[1:end], first.source.place(first.offset, end + 1, first.expansions)
            while self.token.source is first.source and first.offset <= self.token.offset <= first.offset + end:
                self.advance()
        else:
            self.advance()
        if not name.strip():
            self.fail("D395", "`use` needs a file, and this name is empty", place, help=USE_USAGE)
        if self.token.text != AS:
            self.fail("D395", f"expected `as`, found {token_in_words(self.token)}", self.token, help=USE_USAGE)
        self.advance()
        roof = self.token
        if roof.kind != NAME:
            words = token_in_words(roof)
            self.fail("D395", f"expected a name for the roof, found {words}", roof, help=USE_USAGE)
        self.advance()
        self.semicolon(Broken(roof.place))
        self.uses.append(UseEntry(name, first.text == "<", Word(roof.text, roof.place), place, first.source.name))


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
        """An expression with its names put under the roof, the name by which another deck uses this one."""
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
