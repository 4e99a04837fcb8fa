"""From entries as written to definitions as meant: `like`, overrides, `+=`, `remove`, each entry with its history.

A definition refers to its base and is merged with it when asked for, block by block and key by key. An entry with a
kind (`metric settle = ...`, `link upper { ... }`) adds; one without overrides what the base has under that name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field, replace

from ic.grammar.syntax import Call, Deck, Entry, Expression, Group, Let, Name, Setting, Statement, Word
from ic.meaning.complaints import Complaints, an, belongs, known_words
from ic.meaning.csv_files import CsvFiles
from ic.text.files import library_defines
from met.diagnostic import Diagnostic, Label, Place, Problem, did_you_mean, error
from met.frozen import frozen

KINDS = ("arm", "servo", "run", "sweep")
RESERVED = ("links", "initial", "environment", "metrics", "rates")  # what paths of a run begin with, besides joints


@frozen
class Item:
    """One entry of a merged block.

    kind       the word that added it ("link", "metric"); "" for a plain key
    detail     words after the name (`revolute`)
    value      what stands after `=`; None for a block. A call's named arguments and body are in `body`
    overrides  places of what it replaced, latest first
    homes      definitions under whose names this entry is reached: the one that wrote it and those that took it over
    """

    kind: str
    name: str
    detail: tuple[Word, ...]
    value: Expression | None
    body: Block | None
    place: Place
    overrides: tuple[Place, ...] = ()
    appended: tuple[Expression, ...] = ()
    homes: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        return f"{self.kind} {self.name}" if self.kind else self.name


@frozen
class Block:
    """Merged entries by key ("kind name", or the name of a plain key), in order, and statements such as `require`.

    removed  keys of what was removed, each with the number of statements that stood before its `remove`
    """

    items: Mapping[str, Item] = field(default_factory=dict)
    statements: tuple[Statement, ...] = ()
    removed: tuple[tuple[str, int], ...] = ()

    def of_kind(self, kind: str) -> Iterator[Item]:
        return (item for item in self.items.values() if item.kind == kind)

    def get(self, key: str) -> Item | None:
        return self.items.get(key)


@frozen
class Definition:
    """A definition as written: `default run nominal like base { ... }`."""

    kind: str
    name: str
    group: Group
    default: bool = False

    @property
    def place(self) -> Place:
        return self.group.place


class Definitions:
    """All definitions and lets of a deck, by kind and name; and the CSV files that it names."""

    def __init__(self, deck: Deck, complaints: Complaints) -> None:
        self.lets: dict[str, Let] = {}
        self.csv_files = CsvFiles(deck)
        self._by_kind: dict[str, dict[str, Definition]] = {kind: {} for kind in KINDS}
        self._merged: dict[tuple[str, str], Block] = {}
        self._failed: set[tuple[str, str]] = set()
        self._complaints = complaints
        self._file = deck.file
        for entry in deck.entries:
            with complaints.gather():
                self._enter(entry)
        self._check_defaults()

    def of_kind(self, kind: str) -> Mapping[str, Definition]:
        return self._by_kind[kind]

    def find(self, kind: str, name: Word) -> Definition:
        """The definition of this name. Raises D041 with what was probably meant."""
        known = self._by_kind[kind]
        if name.text in known:
            return known[name.text]
        for other, definitions in self._by_kind.items():
            if name.text in definitions:
                raise Problem(error(
                    "D042", f"`{name.text}` is {an(other)}, and {an(kind)} is needed here", name.place,
                    also=[Label(definitions[name.text].place, "defined here")],
                    help=known_words(f"{kind}s of this deck", known)))
        file = library_defines(kind, name.text)
        include = [f"a standard deck defines it: add `#include <{file}>`"] if file else did_you_mean(name.text, known)
        raise Problem(error("D041", f"no {kind} `{name.text}`", name.place,
                            help=[*include, known_words(f"{kind}s of this deck", known)]))

    def block(self, definition: Definition) -> Block | None:
        """The definition merged with its bases; None where that failed (and was told)."""
        chain: list[Definition] = []
        at: Definition | None = definition
        while at is not None and (at.kind, at.name) not in self._merged:
            key = (at.kind, at.name)
            if key in self._failed:
                return None
            if any(at is seen for seen in chain):
                self._failed.update((d.kind, d.name) for d in chain)
                loop = [*chain[next(i for i, d in enumerate(chain) if d is at):], at]
                self._complaints.error(
                    "D043", f"{at.kind} `{at.name}` is like itself: " + " like ".join(f"`{d.name}`" for d in loop),
                    at.place, also=[Label(d.place, f"`{d.name}`") for d in loop[1:-1]],
                    help="let one of them stand alone, or be like something else")
                return None
            chain.append(at)
            base = None
            if at.group.like is not None:
                try:
                    base = self.find(at.kind, _single(at.group.like))
                except Problem as problem:
                    self._complaints.add(*problem.diagnostics)
                    self._failed.update((d.kind, d.name) for d in chain)
                    return None
            at = base
        block = self._merged[(at.kind, at.name)] if at is not None else None
        above = at
        for each in reversed(chain):
            base_name = f"{each.kind} `{above.name}`" if above is not None else None
            block = merge(block, each.group.body, home=each.name, base_name=base_name, complaints=self._complaints)
            self._merged[(each.kind, each.name)] = block
            above = each
        return block

    def homes(self, definition: Definition) -> tuple[str, ...]:
        """Names of the definition and its bases, outermost base first."""
        names = [definition.name]
        at = definition
        while at.group.like is not None:
            base = self._by_kind[at.kind].get(at.group.like.text)
            if base is None or base.name in names:
                break
            names.append(base.name)
            at = base
        return tuple(reversed(names))

    def _enter(self, entry: Entry) -> None:
        if isinstance(entry, Let):
            earlier = self.lets.get(entry.name.text)
            if earlier is not None:
                raise Problem(_twice("let", entry.name.text, entry.name.place, earlier.name.place))
            self.lets[entry.name.text] = entry
        elif isinstance(entry, Group):
            self._define(entry)
        elif isinstance(entry, Setting) and [word.text for word in entry.words] == ["sweep"]:
            raise Problem(error("D120", "sweeps made of others are not in this version", entry.place,
                                help="write one sweep, with a `vary` line for each parameter"))
        else:
            name = entry.path[0].text if isinstance(entry, Setting) and entry.path else "..."
            raise Problem(error(
                "D044", "a deck holds definitions and `let`s; this is neither", entry.place,
                help=[f"a value: `let {name} = ...;`", "a definition: `arm`, `servo`, `run` or `sweep`, a name and a "
                      "block in braces"]))

    def _define(self, group: Group) -> None:
        words = list(group.words)
        default = len(words) > 1 and words[0].text == "default"
        if default:
            words.pop(0)
        kind = words[0]
        lower = [word.text.lower() for word in group.words[:2]]
        if kind.text not in KINDS and (lower[0] in KINDS or (lower[0] == "default" and lower[-1] in KINDS)):
            meant = f"{lower[0]} {lower[-1]}" if lower[0] == "default" else lower[0]
            raise Problem(error("D045", f"no kind of definition `{kind.text}`", kind.place,
                                help=f"write `{meant}`: the language's words are in lower case"))
        if kind.text not in KINDS:
            raise Problem(error("D045", f"no kind of definition `{kind.text}`", kind.place,
                                help=[*did_you_mean(kind.text, KINDS), *belongs(kind.text),
                                      "kinds: arm, servo, run, sweep"]))
        if len(words) == 1:
            raise Problem(error("D046", f"this {kind.text} has no name", kind.place,
                                help=f"write `{kind.text} NAME {{ ... }}`"))
        if len(words) > 2:
            raise Problem(error("D047", f"`{words[2].text}` after the name of {an(kind.text)}", words[2].place,
                                help=f"write `{kind.text} {words[1].text} {{ ... }}`, `like BASE` before the brace"))
        if default and kind.text not in ("run", "sweep"):
            raise Problem(error("D048", f"{an(kind.text)} cannot be the default", group.words[0].place,
                                help="`default` marks the run or sweep that `met run` takes unless told another"))
        if (group.of is not None) != (kind.text == "sweep") or (kind.text == "sweep" and group.like is not None):
            usage = f"sweep {words[1].text} of RUN {{ ... }}" if kind.text == "sweep" else f"{kind.text} NAME like BASE"
            raise Problem(error("D049", "a sweep is `of` a run, other definitions are `like` another", kind.place,
                                help=f"write `{usage}`"))
        name = words[1]
        if name.text in RESERVED and kind.text in ("arm", "servo"):  # whose names begin paths of parameters
            raise Problem(error("D166", f"`{name.text}` begins paths of its own, so no {kind.text} may be called so",
                                name.place, help=f"give the {kind.text} another name"))
        spaces = ("run", "sweep") if kind.text in ("run", "sweep") else (kind.text,)
        for space in spaces:
            if name.text in self._by_kind[space]:
                raise Problem(_twice(space, name.text, name.place, self._by_kind[space][name.text].place))
        self._by_kind[kind.text][name.text] = Definition(kind.text, name.text, group, default)

    def _check_defaults(self) -> None:
        first: dict[str, Definition] = {}  # of each file: decks that can be included together have one each
        for each in self._defaults():
            known = first.setdefault(each.place.file, each)
            if known is not each:
                self._complaints.error("D050", f"`{each.name}` is a second default", each.place,
                                       also=[Label(known.place, "the first")], help="keep one `default`")

    def _defaults(self) -> list[Definition]:
        return [d for kind in ("run", "sweep") for d in self._by_kind[kind].values() if d.default]

    def default(self) -> Definition | None:
        """The run or sweep marked `default`: the deck's own, else that of the one included file that has one."""
        found = self._defaults()
        own = [each for each in found if each.place.file == self._file]
        return own[0] if own else found[0] if len({each.place.file for each in found}) == 1 else None


def merge(base: Block | None, body: tuple[Entry, ...], *, home: str | None, base_name: str | None,
          complaints: Complaints) -> Block:
    """The base's entries with `body` upon them.

    home       name of the definition that writes `body`; None for a use, whose entries no definition's path reaches
    base_name  what to call the base in messages; None where there is none
    """
    merger = _Merger(base or Block(), home, base_name, complaints)
    for entry in body:
        with complaints.gather():
            merger.enter(entry)
    return Block(merger.items, tuple(merger.statements), tuple(merger.removed))


class _Merger:
    def __init__(self, base: Block, home: str | None, base_name: str | None, complaints: Complaints) -> None:
        homes = (home,) if home else ()
        self.home, self.base_name, self.complaints = homes, base_name, complaints
        self.items = {key: _taken_over(item, homes) for key, item in base.items.items()}
        self.statements = list(base.statements)
        self.removed = list(base.removed)
        self.names: dict[str, list[str]] = {}
        for key, item in self.items.items():
            self.names.setdefault(item.name, []).append(key)
        self.written: dict[str, Place] = {}

    def enter(self, entry: Entry) -> None:
        if isinstance(entry, Let):
            raise Problem(error("D051", "`let` stands inside a definition", entry.place,
                                help="move it out: a `let` belongs to the whole deck"))
        if isinstance(entry, Statement):
            if [word.text for word in entry.words] == ["remove"]:
                self._remove(entry)
            else:
                self.statements.append(entry)
            return
        if isinstance(entry, Setting):
            words, name = entry.words, ".".join(word.text for word in entry.path)
        else:
            if entry.like is not None or entry.of is not None:
                raise Problem(
                    error(
                        "D052",
                        "`like` and `of` belong to definitions, not to the blocks inside",
                        entry.place,
                        help="write the block without it; what is not written is taken from the base",
                    )
                )
            words, name = entry.words[:-1][:1], entry.words[min(1, len(entry.words) - 1)].text
        detail = entry.words[2:] if isinstance(entry, Group) else ()
        kind = words[0].text if words else ""
        if isinstance(entry, Setting) and entry.operator == "+=":
            self._append(entry, name)
            return
        earlier = self._earlier(kind, name, entry.place)
        key = earlier.key if earlier else (f"{kind} {name}" if kind else name)
        if key in self.written:
            raise Problem(_twice(kind, name, entry.place, self.written[key]))
        if kind and earlier:
            raise Problem(
                error(
                    "D053",
                    f"{kind} `{name}` is in {self.base_name or 'the base'} already",
                    entry.place,
                    also=[Label(earlier.place, "here")],
                    help=[
                        f"leave out the word `{kind}` to change it",
                        f"`remove {name};` first, to put another in its place",
                    ],
                )
            )
        self.written[key] = entry.place
        self.names.setdefault(name, []).append(key) if earlier is None else None
        self.items[key] = self._made(entry, kind, name, detail, earlier)

    def _made(
        self, entry: Setting | Group, kind: str, name: str, detail: tuple[Word, ...], earlier: Item | None
    ) -> Item:
        if isinstance(entry, Setting):
            value, body = open_call(entry.value, self.home[0] if self.home else None, self.complaints)
            if earlier is None:
                return Item(kind, name, detail, value, body, entry.place, homes=self.home)
            return Item(earlier.kind, name, earlier.detail, value, body, entry.place,
                        (earlier.place, *earlier.overrides), homes=self.home)
        if earlier is not None and earlier.body is None and not isinstance(earlier.value, (Call, Name)):
            raise Problem(error("D054", f"`{name}` is a value, not a block", entry.place,
                                also=[Label(earlier.place, "written here")], help=f"write `{name} = ...;`"))
        body = merge(earlier.body if earlier else None, entry.body, home=self.home[0] if self.home else None,
                     base_name=f"`{name}`" if earlier else None, complaints=self.complaints)
        if earlier is None:
            return Item(kind, name, detail, None, body, entry.place, homes=self.home)
        return replace(earlier, body=body, detail=detail or earlier.detail)

    def _earlier(self, kind: str, name: str, place: Place) -> Item | None:
        if kind:
            return self.items.get(f"{kind} {name}")
        if name in self.items:
            return self.items[name]
        keys = self.names.get(name, [])
        if len(keys) > 1:
            both = [self.items[key] for key in keys]
            raise Problem(error(
                "D055", f"`{name}` may be " + " or ".join(f"the {item.kind} `{name}`" for item in both), place,
                also=[Label(item.place, item.kind) for item in both], help="give them different names in the base"))
        return self.items[keys[0]] if keys else None

    def _append(self, entry: Setting, name: str) -> None:
        earlier = self._earlier("", name, entry.place)
        if earlier is None or earlier.value is None:
            raise Problem(error("D056", f"nothing is in `{name}` yet to append to", entry.place,
                                help=f"write `{name} = ...;`"))
        self.items[earlier.key] = replace(earlier, appended=(*earlier.appended, entry.value))

    def _remove(self, entry: Statement) -> None:
        if not isinstance(entry.value, Name):
            raise Problem(error("D057", "`remove` takes a name", entry.place, help="write `remove NAME;`"))
        name = entry.value.text
        earlier = self._earlier("", name, entry.value.place)
        if earlier is None:
            known = [item.name for item in self.items.values()]
            raise Problem(error("D058", f"nothing named `{name}` to remove", entry.value.place,
                                help=[*did_you_mean(name, known), known_words("there is", known)]))
        del self.items[earlier.key]
        self.names[name].remove(earlier.key)
        self.written.pop(earlier.key, None)
        self.removed.append((earlier.key, len(self.statements)))


def overlay(base: Block, over: Block) -> Block:
    """The base's entries with those of a use upon them, which no definition's path reaches."""
    items = dict(base.items)
    for key, item in over.items.items():
        earlier = items.get(key)
        if earlier is None:
            items[key] = replace(item, homes=())
        elif item.value is None and item.body is not None:
            body = overlay(earlier.body or Block(), item.body)
            items[key] = replace(earlier, body=body)
        else:
            items[key] = replace(item, homes=(), overrides=(*item.overrides, earlier.place, *earlier.overrides))
    removed = ((key, len(base.statements) + before) for key, before in over.removed)
    return Block(items, (*base.statements, *over.statements), (*base.removed, *removed))


def open_call(value: Expression, home: str | None, complaints: Complaints) -> tuple[Expression, Block | None]:
    """A call's named arguments and body as a block, so that they can be overridden one by one."""
    if not isinstance(value, Call) or (value.body is None and not value.named):
        return value, None
    named = tuple(Setting((), (word,), "=", inner, word.place) for word, inner in value.named)
    block = merge(None, (*named, *(value.body or ())), home=home, base_name=None, complaints=complaints)
    return Call(value.name, value.positional, (), None, value.place), block


def _taken_over(item: Item, homes: tuple[str, ...]) -> Item:
    """The item of a base, now reached under the name of the definition that took it over too."""
    if not homes:
        return item
    body = item.body
    if body is not None:
        body = replace(body, items={key: _taken_over(inner, homes) for key, inner in body.items.items()})
    return replace(item, body=body, homes=(*(h for h in item.homes if h not in homes), *homes))


def _single(name: Name) -> Word:
    if len(name.path) > 1:
        raise Problem(error("D059", f"`{name.text}` is a path; the name of a definition is needed", name.place,
                            help=f"write `{name.path[0].text}`"))
    return name.path[0]


def _twice(kind: str, name: str, place: Place, earlier: Place) -> Diagnostic:
    what = f"{kind} `{name}`" if kind else f"`{name}`"
    helps = ["remove one of the two"]
    if (place.file, place.line, place.column) == (earlier.file, earlier.line, earlier.column):
        helps = ["its file is included twice: begin that file with `#pragma once`"]
    return error("D040", f"{what} is written twice", Label(place, "again"), also=[Label(earlier, "first")], help=helps)
