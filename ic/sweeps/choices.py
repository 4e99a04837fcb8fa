"""Choices of a sweep that decide the structure of a case: words, models, rates, macros; and a run with its choices.

A number that a model takes is an input of the program, and cases that differ in it alone run together. What decides
the program itself makes another structure: a servo, a law, an integrator, a rate, a word such as `world`. For each
choice the run is resolved as the deck that one would write by hand, `run NAME like BASE { ... }` with the choice in it;
for each value of a macro the deck is read again with `-D`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ic.grammar.syntax import (
    Call,
    Entry,
    Expression,
    Group,
    List,
    Name,
    Number,
    Setting,
    String,
    Unit,
    WithUnit,
    Word,
    place_of,
    spanned,
    spell,
)
from ic.language import BLOCKS, choices
from ic.meaning.definitions.merge import MergedBlock
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.expressions.evaluate import FUNCTIONS, evaluate
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value, ValueList, measure_of
from ic.meaning.mechanics.matter import SHAPES
from ic.meaning.parameters.owner import A_RUN_FOR_EACH
from met import models, units
from met.diagnostic import Label, Place, Problem, did_you_mean, error
from met.frozen import frozen
from met.trace import Scalar

MACRO = "macro"
"""The first word of a macro's path, before a space: `macro PAYLOAD`."""

OF_RUN, OF_JOINT, OF_SERVO = choices(""), choices("JOINT"), choices("SERVO")
SENSOR = "sensor"
ONE_OF_TWO = tuple(f"{head}.{name}" for head in ("environment", "initial") for name in choices(head))
"""Paths of words among which a sweep may choose."""


@frozen
class Option:
    """One choice: its text, its value, and its place."""

    text: str
    expression: Expression
    place: Place


@frozen
class ChoiceColumn:
    """A column of a sweep that decides the structure, with an option for each of its values."""

    path: str
    place: Place
    options: tuple[Option, ...]

    def __len__(self) -> int:
        return len(self.options)

    @property
    def macro(self) -> str:
        """The macro's name; "" where it is none."""
        head, _, name = self.path.partition(" ")
        return name if head == MACRO else ""


Choices = tuple[tuple[ChoiceColumn, Option], ...]


def decides_structure(definitions: Definitions, path: str, values: Expression, names: Names) -> bool:
    """Return True if this path decides the structure; a model's words do."""
    first, *rest = definitions.split(path)
    if path in definitions.lets:
        return False
    if path in OF_RUN or (first == "rates" and rest) or path in ONE_OF_TWO:
        return True
    if first in definitions.of_kind("servo"):
        return (len(rest) == 1 and rest[0] in OF_SERVO) or _are_words(values, names)
    if len(rest) == 1 and rest[0] in OF_JOINT:
        return True
    if rest[:1] == ["servo"] and len(rest) == 2 and rest[1] in OF_SERVO:
        return True
    if first == "sensors" and len(rest) == 2 and rest[1] == "rate":
        return True
    has_words = first in ("environment", "sensors", "guides") or rest[:1] in [[word] for word in OF_JOINT]
    return has_words and _are_words(values, names)


def _are_words(values: Expression, names: Names) -> bool:
    items = values.items if isinstance(values, List) else ()
    models = any(isinstance(item, Call) and item.name.text not in FUNCTIONS for item in items)
    return models or word_in(values, names) is not None


def word_in(listed: Expression, names: Names) -> Name | String | None:
    """The first item of a list that is a text, or a name without a value and without a similar one."""

    def is_word(item: Expression) -> bool:
        if not isinstance(item, Name):
            return isinstance(item, String)
        known = names.knows(item.text) or did_you_mean(item.text, names.definitions.lets)
        return len(item.path) == 1 and not known

    items = listed.items if isinstance(listed, List) else ()
    return next((item for item in items if all(is_word(other) for other in items)), None)  # type: ignore[return-value]


def refuse_words(path: str, place: Place, values: Expression, names: Names) -> None:
    """Raise Problem D122 for words, models and lists where numbers vary. place: of the path"""
    if path == "record":
        raise Problem(error("D122", "`record` cannot vary", place, help="record all that any case needs"))
    items = values.items if isinstance(values, List) else ()
    model = next((item for item in items if isinstance(item, Call) and item.name.text not in FUNCTIONS), None)
    if model is not None:
        raise Problem(
            error(
                "D122",
                f"`{path}` cannot vary over `{model.name.text}` and the like",
                place_of(model),
                help=[f"vary a parameter of it: `vary {path}.PARAMETER = [...];`", A_RUN_FOR_EACH],
            )
        )
    word = word_in(values, names)
    if word is not None:
        helps = [A_RUN_FOR_EACH]
        if isinstance(word, Name) and not _is_word(path):
            helps.append(f"where a number is meant, define it: `let {word.text} = ...;`")
        raise Problem(error("D122", f"`{path}` cannot vary over words", place_of(word), help=helps))


def _is_word(path: str) -> bool:
    """Return True if a path ends with a key of a shape, a block or a model whose value is always a word."""
    *_, holder, name = ("", *path.split("."))
    if holder == "shape":
        declared = [p for shape in SHAPES.values() for p in shape.parameters]
        entries = []
    else:
        available = [model for kind in models.GROUPS for model in models.available(kind).values()]
        declared = [p for model in available for p in models.written(model)]
        entries = [entry for block in BLOCKS.values() for entry in block.entries]
    are_words = [p.shape in ("word", "words") for p in declared if p.name == name]
    are_words += [entry.varies != "number" for entry in entries if entry.name == name]
    return bool(are_words) and all(are_words)


def path_place(entry: Setting) -> Place:
    """The place of the path of a `vary`, without the word `macro`."""
    return spanned(entry.path[0].place, entry.path[-1].place)


def check_constant(path: str, entry: Setting, names: Names, varied: Mapping[str, Place]) -> None:
    """Raise Problem D121 where the values were computed from varied ones. varied: all paths of the sweep"""
    for other in names.followed:
        if other == path:
            raise Problem(
                error(
                    "D121",
                    f"the values of `{path}` depend on `{path}` itself, which varies",
                    place_of(entry.value),
                    help="write numbers that stand still",
                )
            )
        raise Problem(
            error(
                "D121",
                f"the values of `{path}` depend on `{other}`, which varies too",
                place_of(entry.value),
                also=[Label(varied[other], "varies here")],
                help=[
                    "write numbers that stand still",
                    f"or compute it from `{other}` where it is defined, and vary `{other}` alone",
                ],
            )
        )


def choice_column(path: str, entry: Setting, names: Names) -> ChoiceColumn:
    """The options of a `vary` or of a line of a `zip`."""
    values = entry.value
    if isinstance(values, List):
        options = [_option(item, names, None) for item in values.items]
    elif isinstance(values, WithUnit) and isinstance(values.inner, List):
        options = [
            _option(WithUnit(item, values.unit, place_of(item)), names, values.unit) for item in values.inner.items
        ]
    else:
        listed = evaluate(values, names.find) if not isinstance(values, (Name, String)) else None
        if not isinstance(listed, ValueList):
            raise Problem(
                error(
                    "D126",
                    f"`{path}` varies over a list, and this is one value",
                    place_of(values),
                    help=f"write `vary {path} = [{spell(values)}, ...];`",
                )
            )
        options = [_number(item, listed.unit) for item in listed.items if isinstance(item, Value)]
    if not options:
        raise Problem(error("D126", f"`{path}` has no values", place_of(values), help="one at least"))
    return ChoiceColumn(path, path_place(entry), tuple(options))


def _option(item: Expression, names: Names, unit: Unit | None) -> Option:
    """The option of a list's item; one that is a number is named by its value, however it is written."""
    place = place_of(item.inner if isinstance(item, WithUnit) and unit is not None else item)
    is_model = isinstance(item, Call) and item.name.text not in FUNCTIONS
    if not is_model and not isinstance(item, String) and not (isinstance(item, Name) and not names.is_value(item)):
        value = names.evaluate(item)
        if isinstance(value, Value):
            if isinstance(item, WithUnit) and unit is not None:  # whose unit stands after the list
                item = WithUnit(item.inner, replace(unit, place=place), place)
            return Option(_number(value, unit or value.unit).text, item, place)
    return Option(spell(item), item, place)


def _number(value: Value, unit: Unit | None) -> Option:
    """The option of a choice that is a number. Raises Problem D121 where it depends on what the sweep varies."""
    if isinstance(value.number, Scalar):
        raise Problem(
            error(
                "D121",
                "this value depends on what the sweep varies",
                value.place,
                help="write numbers that stand still",
            )
        )
    measure = measure_of(unit) if unit is not None else units.ONE
    text = measure.decimal(float(value.number))
    with_unit = f"{text} {unit.text}" if unit is not None else text
    return Option(with_unit, Number(float(text), unit, value.place, text), value.place)


# A run with its choices put in


def with_choices(definitions: Definitions, run: Definition, choices: Choices) -> tuple[Definitions, Definition]:
    """The deck's definitions and the run with these choices (except macros, which make another deck)."""
    tree: dict[str, Any] = {}
    servos: list[Definition] = []
    chosen_values = []
    for column, option in choices:
        if column.macro:
            continue
        chosen_values.append(f"{column.path} = {option.text}")
        first, *rest = definitions.split(column.path)
        servo = definitions.of_kind("servo").get(first)
        if servo is not None and rest:
            if len(rest) > 1 and rest[0] != SENSOR:
                raise Problem(
                    error(
                        "D122",
                        f"`{column.path}` cannot vary by itself",
                        column.place,
                        help=f"vary all of it: `vary {first}.{rest[0]} = [...];`",
                    )
                )
            earlier = next((other for other in servos if other.name == first), servo)
            entry = nested_entry(in_servo(rest, definitions.block(earlier)), option.expression, column.place)
            servos = [
                *(other for other in servos if other is not earlier),
                replace(earlier, extra_entries=(*earlier.extra_entries, entry)),
            ]
            continue
        _place(tree, keys_of(first, rest, definitions.block(run)), column, option)
    replaced = definitions.replacing(*servos)
    if not tree:
        return replaced, run
    body = tuple(_entries(tree))
    base = Name((Word(run.name, run.place),), run.place)
    name = f"{run.name} with {', '.join(chosen_values)}"
    group = Group((*run.group.words[:-1], Word(name, run.place)), base, None, body, run.place)
    return replaced, Definition("run", name, group)


def keys_of(first: str, rest: Sequence[str], run: MergedBlock | None) -> tuple[str, ...]:
    """The keys in a run's block under which the path's value is written. run: that block so far"""
    if rest and rest[0] == "servo":
        servos = run.get("servos") if run is not None else None
        use = servos.body.get(first) if servos is not None and servos.body is not None else None
        return ("servos", first, *in_servo(rest[1:], use.body if use is not None else None))
    if first in ("sensors", "guides") and rest:
        return tuple(rest)
    return (first, *rest)


def in_servo(keys: Sequence[str], block: MergedBlock | None) -> tuple[str, ...]:
    """The keys in a servo's block under which the rest of a path is written; a sensor without its word where the block
    has it."""
    if len(keys) < 2 or keys[0] != SENSOR:
        return tuple(keys)
    is_sensor = block is not None and f"{SENSOR} {keys[1]}" in block.items
    return (keys[1] if is_sensor else f"{SENSOR} {keys[1]}", *keys[2:])


def nested_entry(keys: Sequence[str], value: Expression, place: Place) -> Entry:
    """A value as a block writes it: `servos { elbow { rate = ...; } }`."""
    *words, name = (Word(word, place) for word in keys[-1].split())
    entry: Entry = Setting(tuple(words), (name,), "=", value, place)
    for key in reversed(keys[:-1]):
        entry = _group(key, (entry,), place)
    return entry


def _group(key: str, body: tuple[Entry, ...], place: Place) -> Group:
    return Group(tuple(Word(word, place) for word in key.split()), None, None, body, place)


def _place(tree: dict[str, Any], keys: Sequence[str], column: ChoiceColumn, option: Option) -> None:
    """Put a choice into a tree of entries by the words of its path. Raises Problem D123 where another one sets the
    same."""
    branch = tree
    for key in keys[:-1]:
        branch = branch.setdefault(key, {})
        if not isinstance(branch, dict):
            raise _both(branch[0], column)
    taken = branch.get(keys[-1])
    if taken is not None:
        raise _both(taken[0] if isinstance(taken, tuple) else column, column)
    branch[keys[-1]] = (column, option)


def _both(earlier: ChoiceColumn, later: ChoiceColumn) -> Problem:
    """The error for two varied paths that set the same (D123)."""
    return Problem(
        error(
            "D123",
            f"`{earlier.path}` and `{later.path}` set the same",
            later.place,
            also=[Label(earlier.place, "the first")],
            help="vary one of them, or go two ways: two sweeps, and `sweep NAME = ONE + OTHER;`",
        )
    )


def _entries(tree: dict[str, Any]) -> Iterator[Entry]:
    """The entries of a deck that a tree of choices stands for."""
    for key, inner in tree.items():
        if isinstance(inner, dict):
            entries = tuple(_entries(inner))
            place = entries[0].place
            yield _group(key, entries, place)
        else:
            column, option = inner
            yield nested_entry((key,), option.expression, column.place)
