"""The result of each stage, as text: `met dump STAGE deck.ic`.

A stage is a function from `DumpRequest` to lines, offered as an entry point in the group `met.stages` by the lowest
package that may import all it needs: tokens, syntax, model and plan from here, program and kernel from
batch/terminal/dump.py.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import ic
from ic.grammar.syntax import Call, Entry, Group, Let, Setting, Statement, spell
from ic.language import DEFINITIONS
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.definitions.resolve import Definitions
from ic.read import read
from ic.text.complaints import Complaints
from ic.text.preprocess import preprocess
from met.diagnostic import Place, Problem, did_you_mean, error
from met.frozen import frozen
from met.host.entry_points import offered
from met.plan import Plan
from met.plan import file as plan_file

GROUP = "met.stages"
ORDER = ("tokens", "syntax", "model", "plan", "program", "kernel")  # others come after
WRITTEN = ("tokens", "syntax", "model")  # stages before anything is set from outside of the deck


@frozen
class DumpRequest:
    """A request for a stage of a deck; select: runs of its plan (None: the only one, else the default)."""

    deck: str
    include_dirs: tuple[str, ...] = ()
    defines: tuple[str, ...] = ()
    select: Sequence[str] | None = None
    settings: tuple[str, ...] = ()

    def plan(self) -> Plan:
        """The plan, compiled, or read from a plan file. Raises Problem."""
        if self.deck.endswith(".json"):
            return plan_file.read(self.deck)
        return ic.compile(
            self.deck, include_dirs=self.include_dirs, defines=self.defines, set=self.settings, select=self.select
        )


Stage = Callable[[DumpRequest], Iterator[str]]


def stage_names() -> list[str]:
    """All stages, in their order."""
    names = {point.name for point in offered(GROUP)}
    return [name for name in ORDER if name in names] + sorted(names - set(ORDER))


def find_stage(name: str) -> Stage:
    """The function of a stage. Raises Problem D172 with what was probably meant."""
    point = next((point for point in offered(GROUP) if point.name == name), None)
    if point is None:
        names = stage_names()
        helps = [*did_you_mean(name, names), f"stages: {', '.join(names)}"]
        raise Problem(error("D172", f"no stage `{name}`", help=helps))
    stage: Stage = point.load()
    return stage


def tokens(request: DumpRequest) -> Iterator[str]:
    """Tokens after the preprocessor: place, kind, text, and the macros that a token came through."""
    deck = preprocess(request.deck, request.include_dirs, request.defines)
    if not deck.complete or any(diagnostic.severity == "error" for diagnostic in deck.diagnostics):
        raise Problem(deck.diagnostics, {source.name: source.text for source in deck.sources})
    for token in deck.tokens:
        place = token.place
        through = "".join(f"  from {step.macro} at {step.use}" for step in place.expansions)
        yield f"{place!s:32} {token.kind:14} {token.text}{through}"


def syntax(request: DumpRequest) -> Iterator[str]:
    """The syntax tree, entry by entry."""
    for entry in read(request.deck, request.include_dirs, request.defines).entries:
        yield from _entry(entry, "")


def model(request: DumpRequest) -> Iterator[str]:
    """Definitions with `like`, overrides, `+=` and `remove` carried out, each entry with the places it overrode."""
    deck = read(request.deck, request.include_dirs, request.defines)
    complaints = Complaints(deck.warnings)
    definitions = Definitions(deck, complaints)
    for name, let in definitions.lets.items():
        yield f"let {name} = {spell(let.value)}{_written(let.place)}"
    for kind in DEFINITIONS:
        for definition in definitions.of_kind(kind).values():
            head = f"{'default ' if definition.default else ''}{kind} {definition.name}"
            if definition.group.of is not None:  # a sweep is not merged: its entries are the written ones
                yield f"{head} of {definition.group.of.text} {{{_written(definition.place)}"
                for entry in definition.group.body:
                    yield from _entry(entry, "    ")
                yield "}"
                continue
            block = definitions.block(definition)
            if block is not None:
                yield f"{head} {{{_written(definition.place)}"
                yield from _block(block, "    ")
                yield "}"
    if complaints.errors:
        raise Problem(complaints.all, {source.name: source.text for source in deck.sources})


def plan(request: DumpRequest) -> Iterator[str]:
    """The run plan, as `met plan -o` writes it, its case tables inside; with a line for each value on a terminal."""
    text = plan_file.dumps(request.plan()).rstrip("\n")
    yield json.dumps(json.loads(text), indent=1) if sys.stdout.isatty() else text


def _entry(entry: Entry, indent: str) -> Iterator[str]:
    """The lines that `met dump syntax` prints of an entry and of all that it contains."""
    match entry:
        case Let():
            kind = "Param" if entry.is_param else "Let"
            yield f"{indent}{kind} {entry.name.text} = {spell(entry.value)}{_written(entry.place)}"
        case Setting():
            words = "".join(f"{word.text} " for word in entry.words)
            path = ".".join(word.text for word in entry.path)
            head, body = _value(entry.value)
            yield f"{indent}Setting {words}{path} {entry.operator} {head}{_written(entry.place)}"
            yield from _entries(body, indent)
        case Statement():
            words = " ".join(word.text for word in entry.words)
            yield f"{indent}Statement {words} {spell(entry.value)}{_written(entry.place)}"
        case Group():
            words = " ".join(word.text for word in entry.words)
            like = f" like {entry.like.text}" if entry.like is not None else ""
            of_base = f" of {entry.of.text}" if entry.of is not None else ""
            from_file = f" from {spell(entry.made_from)}" if entry.made_from is not None else ""
            yield f"{indent}Group {words}{like}{of_base}{from_file}{_written(entry.place)}"
            yield from _entries(entry.body, indent)


def _entries(body: Sequence[Entry], indent: str) -> Iterator[str]:
    for inner in body:
        yield from _entry(inner, indent + "    ")


def _value(value: Any, named_apart: bool = False) -> tuple[str, Sequence[Entry]]:
    """A value as text, with its body if it has one: `settling_time { of = shoulder.qd; }`.

    named_apart: what a call names is shown elsewhere.
    """
    if isinstance(value, Call) and (value.body is not None or named_apart):
        bare = not value.positional and (named_apart or not value.named)
        return (value.name.text if bare else spell(value)), value.body or ()
    return spell(value), ()


def _block(block: MergedBlock, indent: str) -> Iterator[str]:
    """The lines that `met dump model` prints of a merged block."""
    for item in block.items.values():
        yield from _item(item, indent)
    for statement in block.statements:
        words = " ".join(word.text for word in statement.words)
        words += f" {statement.name.text}:" if statement.name is not None else ""
        yield f"{indent}{words} {spell(statement.value)}{_written(statement.place)}"


def _item(item: Item, indent: str) -> Iterator[str]:
    """The lines that `met dump model` prints of a merged entry, with what it overrides."""
    words = " ".join([*([item.kind] if item.kind else []), item.name, *(word.text for word in item.detail)])
    value = "" if item.value is None else f" = {_value(item.value, item.body is not None)[0]}"
    more = "".join(f" += {_value(addition)[0]}" for addition in item.appended)
    opens = " {" if item.body is not None else ""
    overrides = "".join(f", overrides {place}" for place in item.overrides)
    yield f"{indent}{words}{value}{more}{opens}{_written(item.place)}{overrides}"
    if item.body is not None:
        yield from _block(item.body, indent + "    ")
        yield f"{indent}}}"


def _written(place: Place) -> str:
    return f"    // {place}"
