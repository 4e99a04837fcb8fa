"""Definitions of a deck by kind and name, merged with their bases on demand.

A definition refers to its base, or to the file that it is made from (`merge`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

from ic.grammar.syntax import Binary, Call, Deck, Entry, Expression, Group, Let, Name, Setting, Word
from ic.grammar.uses import split_path
from ic.language import DEFINITIONS, EXPERIMENTS, HEADS, OF_A_RUN
from ic.meaning.definitions.csv_files import csv_files
from ic.meaning.definitions.merge import Item, MergedBlock, defined_twice, merge
from ic.meaning.definitions.row_tables import RowTable, row_table
from ic.named_files import MeshFiles
from ic.robots.files import RobotFiles
from ic.text.complaints import Complaints, known_words, where_it_belongs, with_article
from ic.text.edition import FIRST
from ic.text.files import add_include, library_defines
from met.diagnostic import Diagnostic, Label, Place, Problem, did_you_mean, error, meant, write
from met.frozen import frozen
from met.messages.message import shown_place


@frozen
class Definition:
    """A definition as written: `default run nominal like base { ... }`.

    parts: of a sweep made of others, `sweep both = gains + spread;`, which are runs and sweeps
    extra_entries: further entries, each merged over all that the definition writes
    """

    kind: str
    name: str
    group: Group
    default: bool = False
    parts: tuple[Name, ...] = ()
    extra_entries: tuple[Entry, ...] = ()

    @property
    def place(self) -> Place:
        return self.group.place

    @property
    def roof(self) -> str:
        """The roof of the definition; "" for the deck's own."""
        return self.name.rpartition(".")[0] if self.kind not in EXPERIMENTS else ""

    @property
    def run_name(self) -> str:
        """The name of the run that a sweep, search or tuning is of; "" of other definitions."""
        return self.group.of.text if self.group.of is not None else ""

    @property
    def home(self) -> str:
        """The first part of paths that reach its entries; a run with a sweep's choices is called `RUN CHOICES`."""
        return self.name.partition(" ")[0]


class Definitions:
    """All definitions and lets of a deck, by kind and name; and the CSV and URDF files that it names."""

    def __init__(self, deck: Deck, complaints: Complaints) -> None:
        """Enter all definitions and `let`s of a deck; mistakes in them are reported."""
        self.lets: dict[str, Let] = {}
        self.csv_files = csv_files(deck)
        self.robot_files = RobotFiles(deck)
        self.mesh_files = MeshFiles(deck)
        self._row_tables: dict[Place, RowTable | Problem] = {}
        self._by_kind: dict[str, dict[str, Definition]] = {kind: {} for kind in DEFINITIONS}
        self._merged: dict[tuple[str, str], MergedBlock] = {}
        self._failed: set[tuple[str, str]] = set()
        self._meant: dict[tuple[str, str], str] = {}  # by kind and name that there is not, the name that was meant
        self._complaints = complaints
        self.memo: dict[object, Any] = {}  # what later rooms make of arms, servos and lets alone
        self.roofs = deck.roofs
        self._file = deck.file
        self._texts = {source.name: source.text for source in deck.sources}
        self._editions = {source.name: source.edition for source in deck.sources if source.edition > FIRST}
        for entry in deck.entries:
            try:
                self._enter(entry)
            except Problem as problem:
                complaints.add(*problem.diagnostics)
                complaints.note_lost_names(*(word.text for word in getattr(entry, "words", ())[1:]))
        self._check_defaults()

    def replacing(self, *changed: Definition, lets: Sequence[Let] = ()) -> Definitions:
        """A copy of the definitions and lets in which these replace those of their names."""
        if not changed and not lets:
            return self
        other = copy(self)
        other.lets = {**self.lets, **{let.name.text: let for let in lets}}
        other._by_kind = {kind: dict(known) for kind, known in self._by_kind.items()}
        other._merged, other._failed, other._meant = {}, set(), dict(self._meant)
        if not lets and all(definition.kind in EXPERIMENTS for definition in changed):  # arms and servos do not change
            other._merged = {key: block for key, block in self._merged.items() if key[0] not in EXPERIMENTS}
            other._failed = {key for key in self._failed if key[0] not in EXPERIMENTS}
        else:
            other.memo = {}
        for definition in changed:
            other._by_kind[definition.kind][definition.name] = definition
        return other

    def reporting_to(self, complaints: Complaints) -> Definitions:
        """A copy, including all merged blocks so far, that reports mistakes there."""
        other = copy(self)
        other._complaints = complaints
        other._merged, other._failed, other._meant = dict(self._merged), set(self._failed), dict(self._meant)
        return other

    def text_at(self, place: Place) -> str:
        """The characters that a place covers; "" where its text is not known."""
        lines = self._texts.get(place.file, "").splitlines()[place.line - 1 : place.line]
        return lines[0][place.column - 1 : place.column - 1 + place.length] if lines else ""

    def row_table(self, call: Call) -> RowTable:
        """The table of rows with names that `csv("FILE.csv")` means. Raises Problem, the same each time."""
        table = self._row_tables.get(call.place)
        if table is None:
            try:
                table = row_table(call, self.csv_files.get)
            except Problem as problem:
                table = problem
            self._row_tables[call.place] = table
        if isinstance(table, Problem):
            raise table
        return table

    def edition_at(self, place: Place) -> int:
        """The edition of the deck language in which the file of a place is written."""
        return self._editions.get(place.file, FIRST)

    def of_kind(self, kind: str) -> Mapping[str, Definition]:
        return self._by_kind[kind]

    def in_full(self, name: Name) -> Name:
        """A value's name as the deck itself would write it: one in a used deck gets its roof. If the used deck has no
        such value it is unchanged."""
        if not name.roof:
            return name
        first = name.path[0]
        full = f"{name.roof}.{first.text}"
        if full not in self.lets and full not in self._by_kind["servo"]:
            return name
        return Name((Word(full, first.place), *name.path[1:]), name.place)

    def split(self, path: str) -> list[str]:
        """The words of a path, the first of which is a full name where the path begins with a roof."""
        return split_path(path, self.roofs) if self.roofs else path.split(".")

    def under(self, roof: str, names: Iterable[str]) -> list[str]:
        """The full names that are under a roof, as its own deck writes them; all of them where it is ""."""
        return [name[len(roof) + 1 :] for name in names if name.startswith(f"{roof}.")] if roof else list(names)

    def definition_named(self, value: Expression | None) -> str | None:
        """The full name of a definition as a value, alone or with a block; None where the deck has no roof, and names
        are single words."""
        name = value.name if isinstance(value, Call) else value
        return name.text if self.roofs and isinstance(name, Name) else None

    def stays_away(self, name: str) -> list[str]:
        """The remedy for the full name of a run or sweep of a used deck; none for another."""
        roof, _, own = name.rpartition(".")
        kind = self.roofs[roof].left.get(own) if roof in self.roofs else None
        if kind is None:
            return []
        file = self.roofs[roof].use.file
        return [
            f"`{own}` is a {kind} of the deck that is used, and its runs and sweeps stay away: write one of your own, "
            f"or include `{file}`"
        ]

    def find(self, kind: str, name: Word, roof: str = "") -> Definition:
        """The definition of this name. Raises D041 with the name that was probably meant. roof: of the used deck that
        names it"""
        if name.text in self._by_kind[kind]:
            return self._by_kind[kind][name.text]
        known = self.under(roof, self._by_kind[kind])
        for other, definitions in self._by_kind.items():
            if name.text in definitions:
                raise Problem(
                    error(
                        "D042",
                        f"`{name.text}` is {with_article(other)}, and {with_article(kind)} is needed here",
                        name.place,
                        also=[Label(definitions[name.text].place, "defined here")],
                        help=known_words(f"{kind}s of this deck", known),
                    )
                )
        written = name.text[len(roof) + 1 :] if roof else name.text
        file = library_defines(kind, written)
        helps = self.stays_away(name.text) or (
            [add_include(file, name.place)] if file else list(did_you_mean(written, known))
        )
        raise Problem(
            error(
                "D041",
                f"no {kind} `{written}`",
                name.place,
                help=[*helps, known_words(f"{kind}s of this deck", known)],
            )
        )

    def find_or_meant(
        self,
        kind: str,
        name: Word,
        complaints: Complaints,
        *,
        user: Definition | None = None,
    ) -> Definition:
        """The definition of this name, else, with an error, the nearest one, so that its uses are checked too.
        Raises D041 where no name is near.

        user  what is like it, which itself is not meant
        """
        roof = user.roof if user is not None else ""
        try:
            return self.find(kind, name, roof)
        except Problem as problem:
            known = [
                candidate
                for candidate in self._by_kind[kind]
                if (user is None or user.name not in self.homes(self._by_kind[kind][candidate]))
                and (not roof or candidate.startswith(f"{roof}."))
            ]
            near = meant(name.text, known)
            if near is None or any(diagnostic.code != "D041" for diagnostic in problem.diagnostics):
                raise
            complaints.add(*problem.diagnostics)
            self._meant[(kind, name.text)] = near
            return self._by_kind[kind][near]

    def block(self, definition: Definition) -> MergedBlock | None:
        """The definition merged with its bases; None where that failed (already reported)."""
        chain: list[Definition] = []
        current: Definition | None = definition
        while current is not None and (current.kind, current.name) not in self._merged:
            key = (current.kind, current.name)
            if key in self._failed:
                return None
            if any(current is seen for seen in chain):
                self._failed.update((d.kind, d.name) for d in chain)
                loop = [*chain[next(i for i, d in enumerate(chain) if d is current) :], current]
                self._complaints.error(
                    "D043",
                    f"{current.kind} `{current.name}` is like itself: " + " like ".join(f"`{d.name}`" for d in loop),
                    current.place,
                    also=[Label(d.place, f"`{d.name}`") for d in loop[1:-1]],
                    help="let one of them stand alone, or be like something else",
                )
                return None
            chain.append(current)
            base = None
            if current.group.like is not None:
                try:
                    like = current.group.like
                    word = Word(like.text, like.place) if self.roofs else _single(like)
                    base = self.find_or_meant(current.kind, word, self._complaints, user=current)
                except Problem as problem:
                    self._complaints.add(*problem.diagnostics)
                    self._failed.update((d.kind, d.name) for d in chain)
                    return None
            current = base
        block = self._merged[(current.kind, current.name)] if current is not None else None
        above = current
        for ancestor in reversed(chain):
            base_name = f"{ancestor.kind} `{above.name}`" if above is not None else None
            if ancestor.group.made_from is not None:
                base_name = f"`{ancestor.name}`"
                block = self._made_from(ancestor, ancestor.group.made_from)
                if block is None:
                    self._failed.update((d.kind, d.name) for d in chain)
                    return None
            if above is not None:
                self._complaints.note_base(ancestor.place, above.place)
            block = merge(
                block, ancestor.group.body, home=ancestor.home, base_name=base_name, complaints=self._complaints
            )
            for entry in ancestor.extra_entries:
                block = merge(block, (entry,), home=ancestor.home, base_name=base_name, complaints=self._complaints)
            self._merged[(ancestor.kind, ancestor.name)] = block
            above = ancestor
        return block

    @property
    def experiments(self) -> dict[str, Definition]:
        """The definitions that have cases to run, by name: runs, then sweeps, searches and tunings."""
        return {name: definition for kind in EXPERIMENTS for name, definition in self._by_kind[kind].items()}

    def run_blocks(self) -> list[MergedBlock]:
        """The blocks of all runs, each merged with its bases; without those that failed (already reported)."""
        blocks = [self.block(run) for run in self._by_kind["run"].values()]
        return [block for block in blocks if block is not None]

    def have_payloads(self) -> bool:
        """Return True if a run has a payload: with one, the joints of an arm may move a mass where its links have
        none."""
        return any(True for block in self.run_blocks() for _ in block.of_kind("payload"))

    def _made_from(self, definition: Definition, call: Call) -> MergedBlock | None:
        """The block made from a definition's file, as its base; None where that failed (already reported)."""
        with self._complaints.gather():
            body = self.robot_files.arm_entries(call)
            for remark in self.robot_files.remarks(call):
                self._complaints.remark(remark.code, remark.message, remark.at, also=remark.also, help=remark.help)
            return merge(None, body.entries, home=definition.name, base_name=None, complaints=self._complaints)
        return None

    def base_from_file(self, arm: str, *, of_mass: bool = True) -> Item | None:
        """The link `base` of the file that an arm, or one that it is like, is made from; None where there is none.
        of_mass: whether it is none without inertia"""
        for name in reversed(self.homes(self._by_kind["arm"][arm])):
            call = self._by_kind["arm"][name].group.made_from
            base = self.robot_files.arm_entries(call).base if call is not None else None
            if base is not None and (base.weighs or not of_mass):
                return merge(None, (base.entry,), home=name, base_name=None, complaints=self._complaints).get(
                    "link base"
                )
        return None

    def homes(self, definition: Definition) -> tuple[str, ...]:
        """Names of the definition and its bases, outermost base first."""
        names = [definition.name]
        current = definition
        while current.group.like is not None:
            like = current.group.like.text
            base = self._by_kind[current.kind].get(self._meant.get((current.kind, like), like))
            if base is None or base.name in names:
                break
            names.append(base.name)
            current = base
        return tuple(reversed(names))

    def _enter(self, entry: Entry) -> None:
        """Enter one entry of the deck: a `let`, a definition or a sum of sweeps. Raises Problem D044 for others."""
        if isinstance(entry, Let):
            earlier = self.lets.get(entry.name.text)
            if earlier is not None and earlier.is_param and entry.is_param and _includes(earlier, entry):
                overrides = (entry.name.place, *entry.overrides)
                entry = replace(earlier, overrides=overrides, default=earlier.default or entry.value)
            elif earlier is not None:
                raise Problem(_let_twice(entry, earlier))
            self.lets[entry.name.text] = entry
        elif isinstance(entry, Group):
            self._define(entry)
        elif isinstance(entry, Setting) and [word.text for word in entry.words] in (["sweep"], ["default", "sweep"]):
            self._define_sum(entry)
        else:
            name = entry.path[0].text if isinstance(entry, Setting) and entry.path else "..."
            raise Problem(
                error(
                    "D044",
                    "a deck holds definitions and `let`s; this is neither",
                    entry.place,
                    help=[
                        f"a value: `let {name} = ...;`",
                        f"a definition, its name and a block in braces: {', '.join(DEFINITIONS)}",
                        "or a `param`, a `unit`, a loop `for`, and `deck 2;` in the first line",
                    ],
                )
            )

    def _define(self, group: Group) -> None:
        """Enter a definition of a block: its kind, its name, and what it is like or of. Raises Problem."""
        words = list(group.words)
        if (
            len(words) > 2
            and words[1].text in DEFINITIONS
            and words[0].text != "default"
            and meant(words[0].text, ("default",)) is not None
        ):
            self._complaints.error(
                "D045",
                f"no kind of definition `{words[0].text}`",
                words[0].place,
                help=write("default", "did you mean `default`?"),
            )
            words[0] = replace(words[0], text="default")
        default = len(words) > 1 and words[0].text == "default"
        if default:
            words.pop(0)
        kind = words[0]
        lower = [word.text.lower() for word in group.words[:2]]
        meant_kind = lower[-1] if lower[0] == "default" else lower[0]
        if kind.text not in DEFINITIONS and meant_kind in DEFINITIONS:
            written = f"{lower[0]} {lower[-1]}" if lower[0] == "default" else lower[0]
            raise Problem(
                error(
                    "D045",
                    f"no kind of definition `{kind.text}`",
                    kind.place,
                    help=write(
                        written.split()[-1],
                        f"write `{written}`: the language's words are in lower case",
                        old=kind.text,
                    ),
                )
            )
        if kind.text not in DEFINITIONS:
            unknown = error(
                "D045",
                f"no kind of definition `{kind.text}`",
                kind.place,
                help=[
                    *did_you_mean(kind.text, DEFINITIONS),
                    *where_it_belongs(kind.text),
                    known_words("kinds", DEFINITIONS),
                ],
            )
            near = meant(kind.text, DEFINITIONS)
            if near is None or len(words) != 2:
                raise Problem(unknown)
            self._complaints.add(unknown)  # its contents are checked, too
            kind = replace(kind, text=near)
        if len(words) == 1:
            raise Problem(
                error("D046", f"this {kind.text} has no name", kind.place, help=f"write `{kind.text} NAME {{ ... }}`")
            )
        if len(words) > 2:
            if words[2].text in ("like", "of"):
                raise Problem(
                    error(
                        "D047",
                        f"the block of {kind.text} `{words[1].text}` is missing",
                        words[2].place,
                        help="write `{ ... }` behind its base, or `;` where nothing differs",
                    )
                )
            raise Problem(
                error(
                    "D047",
                    f"`{words[2].text}` after the name of {with_article(kind.text)}",
                    words[2].place,
                    help=f"write `{kind.text} {words[1].text} {{ ... }}`, `like BASE` before the brace",
                )
            )
        if default and kind.text not in EXPERIMENTS:
            raise Problem(
                error(
                    "D048",
                    f"{with_article(kind.text)} cannot be the default",
                    group.words[0].place,
                    help="`default` marks a run, sweep, search or tune: that which `met run` takes unless told another",
                )
            )
        of_run = kind.text in OF_A_RUN
        if (group.of is not None) != of_run or (of_run and group.like is not None):
            usage = f"{kind.text} {words[1].text} of RUN {{ ... }}" if of_run else f"{kind.text} NAME like BASE"
            what = kind.text if of_run else "sweep"
            raise Problem(
                error(
                    "D049",
                    f"{with_article(what)} is `of` a run, other definitions are `like` another",
                    kind.place,
                    help=f"write `{usage}`",
                )
            )
        if group.made_from is not None and kind.text != "arm":
            raise Problem(
                error(
                    "D214",
                    f"{with_article(kind.text)} is not made from a file",
                    group.made_from.name.place,
                    help="`from urdf(...)` makes an arm",
                )
            )
        name = words[1]
        if name.text in HEADS and kind.text in ("arm", "servo"):  # whose names begin paths of parameters
            raise Problem(
                error(
                    "D166",
                    f"`{name.text}` begins paths of its own, so no {kind.text} may be called so",
                    name.place,
                    help=f"give the {kind.text} another name",
                )
            )
        self._add(Definition(kind.text, name.text, group, default))

    def _define_sum(self, entry: Setting) -> None:
        """Define a sum such as `sweep both = gains + spread;`."""
        if len(entry.path) > 1 or entry.operator != "=":
            raise Problem(
                error(
                    "D120",
                    "a sweep made of others is `sweep NAME = ONE + OTHER;`",
                    entry.place,
                    help="its name is one word, and `=` follows",
                )
            )
        parts: list[Name] = []
        term = entry.value
        while isinstance(term, Binary) and term.operator == "+" and isinstance(term.right, Name):
            parts.append(term.right)
            term = term.left
        if not isinstance(term, Name) or any(len(part.path) > 1 for part in (*parts, term)):
            place = term.place if not isinstance(term, Binary) else term.right.place
            raise Problem(
                error(
                    "D120",
                    "a sweep is made of runs and sweeps, with `+` between them",
                    place,
                    help=f"write `sweep {entry.path[0].text} = ONE + OTHER;`",
                )
            )
        group = Group((*entry.words, entry.path[0]), None, None, (), entry.place)
        self._add(Definition("sweep", entry.path[0].text, group, len(entry.words) > 1, (term, *reversed(parts))))

    def _add(self, definition: Definition) -> None:
        """Enter a definition under its name, which must be unique in its kind; everything with cases shares one space
        of names."""
        kind, name = definition.kind, definition.group.words[-1]
        for space in EXPERIMENTS if kind in EXPERIMENTS else (kind,):
            if name.text in self._by_kind[space]:
                raise Problem(defined_twice(space, name.text, name.place, self._by_kind[space][name.text].place))
        self._by_kind[kind][name.text] = definition

    def _check_defaults(self) -> None:
        """Report a second `default` of a file (D050)."""
        first: dict[str, Definition] = {}  # of each file: decks that can be included together have one each
        for default in self._defaults():
            known = first.setdefault(default.place.file, default)
            if known is not default:
                self._complaints.error(
                    "D050",
                    f"`{default.name}` is a second default",
                    default.place,
                    also=[Label(known.place, "the first")],
                    help="keep one `default`",
                )

    def _defaults(self) -> list[Definition]:
        return [definition for definition in self.experiments.values() if definition.default]

    def writes(self, definition: Definition) -> bool:
        """Return True if the deck itself, not an included file, contains this definition."""
        return self.writes_at(definition.place)

    def writes_at(self, place: Place) -> bool:
        """Return True if the deck itself, not an included file, contains this place."""
        return shown_place(place).file == self._file

    def default(self) -> Definition | None:
        """The run or sweep marked `default`: the deck's own, else that of the one included file that has one."""
        defaults = self._defaults()
        own = [definition for definition in defaults if self.writes(definition)]
        return own[0] if own else defaults[0] if len({definition.place.file for definition in defaults}) == 1 else None


def _includes(outer: Let, inner: Let) -> bool:
    """Return True if the file of `outer` includes that of `inner`, directly or not."""
    outer_place = shown_place(outer.place)
    return any(file == outer_place.file and line > outer_place.line for file, line in shown_place(inner.place).included)


def _let_twice(entry: Let, earlier: Let) -> Diagnostic:
    """The error that a `let` or `param` is written twice."""
    kind = "param" if entry.is_param else "let"
    diagnostic = defined_twice(kind, entry.name.text, entry.name.place, earlier.name.place)
    file = shown_place(entry.place).file
    if earlier.is_param and any(included == file for included, _ in shown_place(earlier.place).included):
        how = "move this line up" if entry.is_param else f"write `param {entry.name.text} = ...;` there"
        return replace(diagnostic, help=(f"a deck sets a `param` of a file before it includes it: {how}",))
    if entry.is_param and _includes(earlier, entry):
        change = write("param", f"write `param {earlier.name.text}` to set it", old="let", at=earlier.place)
        return replace(diagnostic, help=(change,))
    return diagnostic


def _single(name: Name) -> Word:
    """The only word of a definition's name. Raises Problem D059 for a path."""
    if len(name.path) > 1:
        raise Problem(
            error(
                "D059",
                f"`{name.text}` is a path; the name of a definition is needed",
                name.place,
                help=write(name.path[0].text, old=name.text),
            )
        )
    return name.path[0]
