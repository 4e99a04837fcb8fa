"""Merging of blocks: a base's entries with those written over it, each with its history.

An entry with a kind (`metric settle = ...`, `link upper { ... }`) adds; one without overrides what the base has under
that name. `+=` appends, `remove` takes away. Of two requirements of one name the later one stands.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, replace

from ic.grammar.settings import path_of
from ic.grammar.syntax import Call, Entry, Expression, Group, Let, Name, Setting, Statement, Word, place_of
from ic.text.complaints import Complaints, known_words
from met.diagnostic import Diagnostic, Label, Place, Problem, did_you_mean, error, leave_out, meant, write
from met.frozen import frozen

WITH = "with"
"""Kind of a run's entries `with PATH = VALUE;`, of which the last one for a path counts."""

REQUIREMENT = "requirement"
"""The word in messages for the one statement that may have a name."""


@frozen
class Item:
    """One entry of a merged block.

    kind       the word that added it ("link", "metric"); "" for a plain key
    detail     words after the name (`revolute`)
    value      what stands after `=`; None for a block. A call's named arguments and body are in `body`
    upon       place of the block that was written upon its value, such as `j = drive;` and then `j { kp = 3; }`; the
               latest of several, None where there is none
    overrides  places of what it replaced, latest first
    homes      definitions under whose names this entry is reached: the one that wrote it and those that took it over
    """

    kind: str
    name: str
    detail: tuple[Word, ...]
    value: Expression | None
    body: MergedBlock | None
    place: Place
    overrides: tuple[Place, ...] = ()
    appended: tuple[Expression, ...] = ()
    homes: tuple[str, ...] = ()
    upon: Place | None = None

    @property
    def key(self) -> str:
        return f"{self.kind} {self.name}" if self.kind else self.name

    @property
    def value_place(self) -> Place:
        """The place of the entry's value; that of the entry itself where it has none."""
        return self.place if self.value is None else place_of(self.value)


@frozen
class Removed:
    """A key that `remove` removed, the number of statements before that, and its place."""

    key: str
    before: int
    place: Place


@frozen
class MergedBlock:
    """Merged entries by key ("kind name", or the name of a plain key), in order, and statements such as `require`.

    pending  in a block upon a name: each `remove` of what the block itself does not have, for `overlay`
    """

    items: Mapping[str, Item] = field(default_factory=dict)
    statements: tuple[Statement, ...] = ()
    removed: tuple[Removed, ...] = ()
    pending: tuple[Statement, ...] = ()

    def of_kind(self, kind: str) -> Iterator[Item]:
        return (item for item in self.items.values() if item.kind == kind)

    def get(self, key: str) -> Item | None:
        return self.items.get(key)


def merge(
    base: MergedBlock | None,
    body: tuple[Entry, ...],
    *,
    home: str | None,
    base_name: str | None,
    complaints: Complaints,
    upon_name: bool = False,
) -> MergedBlock:
    """The base's entries with `body` upon them.

    home       name of the definition that writes `body`; None for a use, whose entries no definition's path reaches
    base_name  what to call the base in messages; None where there is none
    upon_name  the body stands behind the name of a definition or a model (`j = drive { ... }`): what it removes may be
               the definition's, which is not known here
    """
    merger = _Merger(base or MergedBlock(), home, base_name, complaints, upon_name)
    for entry in body:
        with complaints.gather():
            merger.enter(entry)
    return MergedBlock(merger.items, tuple(merger.statements), tuple(merger.removed), tuple(merger.pending))


class _Merger:
    """The entries of a block as they are merged: those of its base, with what the block itself writes in their place.

    items  by `KIND NAME`, or NAME of one without a kind
    """

    def __init__(
        self, base: MergedBlock, home: str | None, base_name: str | None, complaints: Complaints, upon_name: bool
    ) -> None:
        homes = (home,) if home else ()
        self.home, self.base_name, self.complaints = homes, base_name, complaints
        self.items = {key: _taken_over(item, homes) for key, item in base.items.items()}
        self.statements = list(base.statements)
        self.removed = list(base.removed)
        self.upon_name, self.pending = upon_name, list(base.pending)
        self.names: dict[str, list[str]] = {}
        for key, item in self.items.items():
            self.names.setdefault(item.name, []).append(key)
        self.written: dict[str, Place] = {}

    def enter(self, entry: Entry) -> None:
        """Enter one entry of a block over what the block has already. Raises Problem."""
        if isinstance(entry, Let):
            raise Problem(
                error(
                    "D051",
                    "`let` stands inside a definition",
                    entry.place,
                    help="move it out: a `let` belongs to the whole deck",
                )
            )
        if isinstance(entry, Statement):
            if entry.words[0].text == "remove":
                self._remove(entry)
            else:
                self._state(entry)
            return
        if isinstance(entry, Setting):
            words, name = entry.words, path_of(entry)
            if [word.text for word in words] == ["param"]:
                raise Problem(
                    error(
                        "D051",
                        "`param` stands inside a definition",
                        entry.place,
                        help="move it out: a `param` belongs to the whole deck",
                    )
                )
        else:
            if entry.like is not None or entry.of is not None or entry.made_from is not None:
                raise Problem(
                    error(
                        "D052",
                        "`like`, `of` and `from` belong to definitions, not to the blocks inside",
                        entry.place,
                        help="write the whole block, without it; a macro (`#define`) holds what blocks have in common",
                    )
                )
            if [word.text for word in entry.words[1:2]] == ["like"] and len(entry.words) == 3:  # `hinge like drive { }`
                joint, _, servo = (word.text for word in entry.words)
                remedy = write(
                    f"{joint} = {servo}", f"write `{joint} = {servo} {{ ... }};`", old=f"{joint} like {servo}"
                )
                raise Problem(
                    error("D052", "`like` belongs to definitions, not to the blocks inside", entry.place, help=[remedy])
                )
            words, name = entry.words[:-1][:1], entry.words[min(1, len(entry.words) - 1)].text
        detail = entry.words[2:]
        if isinstance(entry, Setting) and len(words) > 1:  # `metric top fast = ...`: named as a block would be
            name, detail = words[1].text, (*words[2:], *entry.path)
        kind = words[0].text if words else ""
        if isinstance(entry, Setting) and entry.operator == "+=":
            self._append(entry, name)
            return
        earlier = self._earlier(kind, name, entry.place)
        key = earlier.key if earlier else (f"{kind} {name}" if kind else name)
        if key in self.written:
            raise Problem(defined_twice(kind, name, entry.place, self.written[key]))
        if kind and earlier and kind != WITH:
            helps = [f"`remove {name};` first, to put another in its place"]
            details = [word.text for word in detail]
            if not details:
                helps.insert(0, write("", f"leave out the word `{kind}` to change it", old=f"{kind} "))
            elif details == [word.text for word in earlier.detail]:
                old, out = " ".join((kind, name, *details)), " and ".join(f"`{word}`" for word in (kind, *details))
                helps.insert(0, write(name, f"leave out the words {out} to change it", old=old))
            what = f"{kind} `{name}` is in {self.base_name or 'the base'} already"
            raise Problem(error("D053", what, entry.place, also=[Label(earlier.place, "here")], help=helps))
        self.written[key] = entry.place
        self.names.setdefault(name, []).append(key) if earlier is None else None
        self.items[key] = self._item(entry, kind, name, detail, earlier)

    def _state(self, entry: Statement) -> None:
        """Take a statement; one with a name replaces the base's of that name."""
        if entry.name is not None:
            name = entry.name.text
            key = f"{REQUIREMENT} {name}"
            if key in self.written:
                raise Problem(defined_twice(REQUIREMENT, name, entry.place, self.written[key]))
            self.written[key] = entry.place
            earlier = self._stated(name)
            if earlier is not None:
                self._drop(earlier)
        self.statements.append(entry)

    def _stated(self, name: str) -> Statement | None:
        """The statement of a name."""
        return next(
            (statement for statement in self.statements if statement.name is not None and statement.name.text == name),
            None,
        )

    def _drop(self, statement: Statement) -> None:
        index = next(n for n, other in enumerate(self.statements) if other is statement)
        del self.statements[index]
        self.removed = [replace(removal, before=removal.before - (index < removal.before)) for removal in self.removed]

    def _item(
        self, entry: Setting | Group, kind: str, name: str, detail: tuple[Word, ...], earlier: Item | None
    ) -> Item:
        """The item of an entry: its value, or its block merged with that of the earlier entry of the name."""
        if isinstance(entry, Setting):
            value, body = open_call(entry.value, self.home[0] if self.home else None, self.complaints)
            if earlier is None:
                return Item(kind, name, detail, value, body, entry.place, homes=self.home)
            return Item(
                earlier.kind,
                name,
                earlier.detail,
                value,
                body,
                entry.place,
                (earlier.place, *earlier.overrides),
                homes=self.home,
            )
        if earlier is not None and earlier.body is None and not isinstance(earlier.value, (Call, Name)):
            raise Problem(no_block(name, entry.place, earlier.place))
        body = merge(
            earlier.body if earlier else None,
            entry.body,
            home=self.home[0] if self.home else None,
            base_name=f"`{name}`" if earlier else None,
            complaints=self.complaints,
            upon_name=self.upon_name or (earlier is not None and isinstance(earlier.value, (Call, Name))),
        )
        if earlier is None:
            return Item(kind, name, detail, None, body, entry.place, homes=self.home)
        upon = entry.place if earlier.value is not None else None
        return replace(earlier, body=body, detail=detail or earlier.detail, upon=upon)

    def _earlier(self, kind: str, name: str, place: Place, *, removed: bool = False) -> Item | None:
        """The entry that one of this kind and name replaces. A value set by `with`, whose path may equal the name of
        another entry, is replaced only by `with`. removed: prefer such a value over a plain entry, for `remove`"""
        if kind:
            return self.items.get(f"{kind} {name}")
        keys = [key for key in self.names.get(name, []) if removed or self.items[key].kind != WITH]
        if removed and [self.items[key].kind for key in keys if key != name] == [WITH]:
            return self.items[f"{WITH} {name}"]
        if name in self.items:
            return self.items[name]
        if len(keys) > 1:
            both = [self.items[key] for key in keys]
            raise Problem(
                error(
                    "D055",
                    f"`{name}` may be " + " or ".join(f"the {item.kind} `{name}`" for item in both),
                    place,
                    also=[Label(item.place, item.kind) for item in both],
                    help="give them different names in the base",
                )
            )
        return self.items[keys[0]] if keys else None

    def _append(self, entry: Setting, name: str) -> None:
        """Append the value of a `+=` to the list of an entry before it. Raises Problem D056 where there is none."""
        earlier = self._earlier("", name, entry.place)
        if earlier is None or earlier.value is None:
            lists = [item.name for item in self.items.values() if item.value is not None and item.kind != WITH]
            anew = f"{WITH} {name}" if f"{WITH} {name}" in self.items else name
            raise Problem(
                error(
                    "D056",
                    f"nothing is in `{name}` yet to append to",
                    entry.place,
                    help=did_you_mean(name, lists) or f"write `{anew} = ...;`",
                )
            )
        self.items[earlier.key] = replace(earlier, appended=(*earlier.appended, entry.value))

    def _remove(self, entry: Statement) -> None:
        """Carry out a `remove`: of an item or a requirement of the base, or later of what a use adds."""
        if not isinstance(entry.value, Name) or len(entry.words) > 1:
            meant = entry.value.text if isinstance(entry.value, Name) else "NAME"
            raise Problem(
                error("D057", "`remove` takes a name, and nothing else", entry.place, help=f"write `remove {meant};`")
            )
        name = entry.value.text
        earlier, stated = self._earlier("", name, entry.value.place, removed=True), self._stated(name)
        if earlier is not None and stated is not None:
            message = f"`{name}` may be the {earlier.kind or 'entry'} `{name}` or the {REQUIREMENT} `{name}`"
            also = [Label(earlier.place, earlier.kind or "entry"), Label(stated.place, REQUIREMENT)]
            helps = "give them different names in the base"
            raise Problem(error("D055", message, entry.value.place, also=also, help=helps))
        if stated is not None:
            self._drop(stated)
            self.written.pop(f"{REQUIREMENT} {name}", None)
            return
        if earlier is None:
            if not self.upon_name:
                raise Problem(_nothing(entry, [*self.items.values(), *filter(_name_of, self.statements)]))
            self.pending.append(entry)
            return
        del self.items[earlier.key]
        self.names[name].remove(earlier.key)
        self.written.pop(earlier.key, None)
        self.removed.append(Removed(earlier.key, len(self.statements), entry.place))
        if self.upon_name and not earlier.kind:  # it was written over the definition's, which is removed too
            self.pending.append(entry)


def _meant(entry: Statement) -> Name:
    """The name in a `remove`."""
    assert isinstance(entry.value, Name)
    return entry.value


def _name_of(entry: Item | Statement) -> str:
    """The name of an entry; "" of a statement that has none."""
    if isinstance(entry, Item):
        return entry.name
    return entry.name.text if entry.name is not None else ""


def _nothing(entry: Statement, entries: Iterable[Item | Statement]) -> Diagnostic:
    """The error that a `remove` finds nothing of its name."""
    name, known = _meant(entry), [_name_of(other) for other in entries]
    return error(
        "D058",
        f"nothing named `{name.text}` to remove",
        name.place,
        help=[*did_you_mean(name.text, known), known_words("there is", known)],
    )


def overlay(base: MergedBlock, over: MergedBlock, complaints: Complaints) -> MergedBlock:
    """The base's entries with those of a use over them, which no definition's path reaches. Removals of the use go
    first, so that it may put another in its place."""
    items, removed = dict(base.items), list(base.removed)
    for entry in over.pending:
        named = _of_name(items, _meant(entry).text)
        if named is not None:
            del items[named.key]
            removed.append(Removed(named.key, len(base.statements), entry.place))
        elif not any(removal.key == _meant(entry).text for removal in over.removed):
            complaints.add(_nothing(entry, items.values()))
    for item in over.items.values():
        earlier = items.get(item.key) if item.kind else _of_name(items, item.name)
        if earlier is None:
            items[item.key] = replace(item, homes=())
        elif item.value is None and item.body is not None:
            body = overlay(earlier.body or MergedBlock(), item.body, complaints)
            upon = item.place if earlier.value is not None else None
            items[earlier.key] = replace(earlier, body=body, upon=upon)
        else:
            overrides = (*item.overrides, earlier.place, *earlier.overrides)
            items[earlier.key] = replace(item, kind=earlier.kind, homes=(), overrides=overrides)
    removed += (replace(removal, before=len(base.statements) + removal.before) for removal in over.removed)
    return MergedBlock(items, (*base.statements, *over.statements), tuple(removed))


def _of_name(items: Mapping[str, Item], name: str) -> Item | None:
    """The plain entry of a name, else the one that was added with a kind."""
    return items.get(name) or next((item for item in items.values() if item.name == name), None)


def with_meant_names(block: MergedBlock, keys: Iterable[str], kinds: Iterable[str]) -> MergedBlock:
    """The block with unknown entries, which are reported, under the names that were probably meant: so their contents
    are checked too, and nothing is reported as missing.

    keys, kinds  what the block may have; an entry that it has stays
    """
    items: dict[str, Item] = {}
    keys, kinds, names = tuple(keys), tuple(kinds), [item.name for item in block.items.values() if item.kind]
    for key, item in block.items.items():
        near = None
        if item.kind and item.kind not in kinds:
            near = meant(item.kind, kinds)
            item = replace(item, kind=near) if near is not None else item
        elif not item.kind and item.name not in keys and "." not in item.name:
            near = meant(item.name, (*keys, *names))
            near = near if near in keys else None
            item = replace(item, name=near) if near is not None else item
        if near is None or item.key in block.items or item.key in items:
            items[key] = block.items[key]
        else:
            items[item.key] = item
    return replace(block, items=items)


def refuse_pending(block: MergedBlock, complaints: Complaints) -> None:
    """Report each `remove` of a block upon a name that turned out to have no entries of its own, such as a model's."""
    for entry in block.pending:
        complaints.add(_nothing(entry, block.items.values()))


def no_block(name: str, place: Place, written: Place | None = None) -> Diagnostic:
    """The error that an entry at this place takes no block. written: its value, if it has one"""
    also = [Label(written, "written here")] if written is not None else []
    return error("D054", f"`{name}` is a value, not a block", place, also=also, help=f"write `{name} = ...;`")


def refuse_block(item: Item) -> None:
    """Raise Problem where a block is written over the value of an entry that takes none: one that is a number or a
    word, not the name of something with entries of its own."""
    if item.upon is not None:
        raise Problem(no_block(item.name, item.upon, item.place))


def open_call(value: Expression, home: str | None, complaints: Complaints) -> tuple[Expression, MergedBlock | None]:
    """A call's named arguments and body as a block, so that they can be overridden one by one."""
    if not isinstance(value, Call) or (value.body is None and not value.named):
        return value, None
    named = tuple(Setting((), (word,), "=", inner, word.place) for word, inner in value.named)
    block = merge(None, (*named, *(value.body or ())), home=home, base_name=None, complaints=complaints, upon_name=True)
    return Call(value.name, value.positional, (), None, value.place), block


def _taken_over(item: Item, homes: tuple[str, ...]) -> Item:
    """The item of a base, now also reached under the name of the definition that inherits it."""
    if not homes:
        return item
    body = item.body
    if body is not None:
        body = replace(body, items={key: _taken_over(inner, homes) for key, inner in body.items.items()})
    return replace(item, body=body, homes=(*(h for h in item.homes if h not in homes), *homes))


def defined_twice(kind: str, name: str, place: Place, earlier: Place) -> Diagnostic:
    """The error that a name is defined twice, with the remedy for a file, loop or macro that does it."""
    what = f"{kind} `{name}`" if kind else f"`{name}`"
    named = kind not in ("", WITH, REQUIREMENT)
    helps: list[str] = [leave_out("remove one of the two"), *(["or give one of the two another name"] if named else [])]
    if (place.file, place.line, place.column) == (earlier.file, earlier.line, earlier.column):
        once = "its file is included twice: add `#pragma once` to that file"
        helps = [write("#pragma once", once, at=Place(place.file, 1, 1, 0), where="head")]
        if place.iterations != earlier.iterations:
            index = place.iterations[0].macro
            stem = name.removesuffix(index) if name.endswith(f"_{index}") else f"{name}_"  # its braces were forgotten
            helps = [f"each iteration writes it: name it by the index, as in `{stem}{{{index}}}`"]
            if kind == WITH:
                helps = [
                    f"each iteration writes it: put the index into the path, `{{{index}}}`, "
                    "or write it outside of the loop"
                ]
            if not kind:
                helps = [f"each iteration writes it: put the loop inside, `{name} {{ for {index} in ... {{ ... }} }}`"]
        elif place.macros and place.expansions != earlier.expansions:
            helps = [
                f"macro `{place.macros[-1].macro}` is used twice here: give it the name as an argument, "
                "another one each time, or use it once"
            ]
    return error("D040", f"{what} is written twice", Label(place, "again"), also=[Label(earlier, "first")], help=helps)
