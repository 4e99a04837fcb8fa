"""Settings of the command line, `--set PATH=VALUE`, and of a run, `with PATH = VALUE;`, applied to the deck's
definitions.

What the command line sets counts before what a run sets. A path is one that `vary` takes, or the seed. Where its value
goes is where the deck would say it:

    let      a `let`: its value
    servo    a key of a servo's definition: upon what that writes
    run      what decides the structure of a run: upon every run that is asked for, where it has what the path names
    number   any other number: in place of what the run settles (`expressions.command_line`), as a sweep's coordinate is

Entries of a run that a setting leaves without effect are warned of. An entry that is further out, and a general one of
which other parameters take their value (`q = 0 rad;` and `with initial.hinge.q = 1 rad;`), may stand.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Literal

from ic.grammar.settings import path_of
from ic.grammar.syntax import Call, Entry, Expression, Group, List, Name, Setting, children, place_of
from ic.meaning.definitions.merge import WITH, MergedBlock
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.expressions.conditions import VariedPath
from ic.meaning.expressions.cycles import unit_remedy
from ic.meaning.expressions.evaluate import PURE
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value, ValueList
from ic.meaning.parameters.models import word_of
from ic.meaning.parameters.scope import VARIES, Scope
from ic.sweeps.axes import Column, Sweep, SweepAxis, compared_values
from ic.sweeps.choices import OF_RUN, ONE_OF_TWO, SENSOR, decides_structure, in_servo, keys_of, nested_entry
from ic.text.complaints import Complaints
from met import units
from met.diagnostic import Diagnostic, Label, Place, Problem, error
from met.frozen import frozen
from met.trace import Scalar

SEED = "seed"
Destination = Literal["let", "servo", "run", "number"]


@frozen
class Settings:
    """Entries `PATH=VALUE`, each path once."""

    entries: tuple[Setting, ...] = ()

    def for_destination(self, definitions: Definitions, where: Destination) -> tuple[Setting, ...]:
        return tuple(entry for entry in self.entries if destination(definitions, entry) == where)

    def in_definitions(self, definitions: Definitions) -> Definitions:
        """The deck's definitions with the settings of lets and servos."""
        lets = []
        for entry in self.for_destination(definitions, "let"):
            let = definitions.lets[path_of(entry)]
            overrides = (*entry.overrides, let.given_at, *let.overrides)
            lets.append(replace(let, value=entry.value, overrides=overrides, set_at=entry.place))
        servos: dict[str, Definition] = {}
        for entry in self.for_destination(definitions, "servo"):
            name, *keys = (word.text for word in entry.path)
            servo = servos.get(name) or definitions.of_kind("servo")[name]
            nested = nested_entry(in_servo(keys, definitions.block(servo)), entry.value, entry.place)
            servos[name] = replace(servo, extra_entries=(*servo.extra_entries, nested))
        return definitions.replacing(*servos.values(), lets=lets)

    def of_run(self, definitions: Definitions, run: Definition) -> Settings:
        """The settings that the run makes itself, or inherits, without those made here."""
        own_paths = {path_of(entry) for entry in self.entries}
        return Settings(tuple(entry for entry in _made_by(definitions, run) if path_of(entry) not in own_paths))

    def _over_those_of(self, definitions: Definitions, run: Definition) -> Settings:
        """The settings made here, each with the places of those of the run that it replaces."""
        replaced = {path_of(entry): entry for entry in _made_by(definitions, run)}
        over = {path: (entry.place, *entry.overrides) for path, entry in replaced.items()}
        return Settings(tuple(replace(entry, overrides=over.get(path_of(entry), ())) for entry in self.entries))

    def in_run(self, definitions: Definitions, run: Definition) -> tuple[Definitions, Definition]:
        """The definitions and the run with the settings made here, and by the run itself."""
        own = self.of_run(definitions, run)
        for entry in self._over_those_of(definitions, run).for_destination(definitions, "let"):
            let = definitions.lets[path_of(entry)]  # which has the new value already
            definitions = definitions.replacing(lets=[replace(let, overrides=(*entry.overrides, *let.overrides))])
        return self._in_structure(*own._in_structure(own.in_definitions(definitions), run))

    def _in_structure(self, definitions: Definitions, run: Definition) -> tuple[Definitions, Definition]:
        """The definitions and the run with the settings of its structure; a whole before a part of it."""
        for entry in sorted(self.for_destination(definitions, "run"), key=lambda entry: len(entry.path)):
            if applies_to(definitions, run, entry):
                first, *rest = (word.text for word in entry.path)
                keys = keys_of(first, rest, definitions.block(run))
                run = replace(run, extra_entries=(*run.extra_entries, nested_entry(keys, entry.value, entry.place)))
                definitions = definitions.replacing(run)
        return definitions, run

    def numbers(self, definitions: Definitions, run: Definition) -> dict[str, Setting]:
        """By path, numbers that replace the run's: those set by itself, then those set here."""
        both = (self.of_run(definitions, run), self._over_those_of(definitions, run))
        return {path_of(entry): entry for settings in both for entry in settings.for_destination(definitions, "number")}

    def check_lets(self, definitions: Definitions, complaints: Complaints) -> None:
        """Report lets whose dimension would change. definitions: the deck's own"""
        names, changed = Names(definitions, {}), Names(self.in_definitions(definitions), {})
        for entry in self.for_destination(definitions, "let"):
            let = definitions.lets[path_of(entry)]
            with suppress(Problem):  # of the deck's value, now overridden, or of this one, reported elsewhere
                old, new = names.find(Name((let.name,), let.name.place)), changed.evaluate(entry.value)
                _check_alike(complaints, let.name.text, old, new, let.name.place)

    @property
    def sets_seed(self) -> bool:
        """True if the seed is set."""
        return any(path_of(entry) == SEED for entry in self.entries)

    def fixed_in(self, sweep: Sweep) -> Sweep:
        """The sweep without paths that are set, which no longer vary."""
        paths = {path_of(entry) for entry in self.entries}
        axes = (_without(axis, paths) for axis in sweep.axes)
        return replace(sweep, axes=tuple(axis for axis in axes if axis.columns))

    def check_sweep(self, sweep: Sweep, complaints: Complaints, definitions: Definitions) -> None:
        """Report settings of a structure that the sweep chooses itself, which would have no effect."""
        for entry in self.for_destination(definitions, "run"):  # else it is a number within a choice of the sweep
            path = path_of(entry)
            columns = [column for column in sweep.chosen if path.startswith(f"{column.path}.")]
            for column in columns[:1]:
                complaints.error(
                    "D233",
                    f"this sets `{path}`, which the sweep varies",
                    entry.place,
                    help=VARIES,
                    also=[Label(column.place, f"`{column.path}` varies here")],
                )


def _made_by(definitions: Definitions, run: Definition) -> list[Setting]:
    """The settings that a run makes itself, or inherits, each with those that it replaced."""
    block = definitions.block(run)
    runs = definitions.of_kind("run")
    bodies = [run.group.body, *(runs[name].group.body for name in definitions.homes(run) if name in runs)]
    written = {
        entry.place: entry
        for body in bodies
        for entry in body
        if isinstance(entry, Setting) and [word.text for word in entry.words] == [WITH]
    }
    items = [item for item in block.of_kind(WITH) if item.place in written] if block else []
    return [replace(written[item.place], words=(), overrides=item.overrides) for item in items]


def check_params(definitions: Definitions, complaints: Complaints) -> None:
    """Report each `param` with another dimension from an including deck than in its own file; the file's value is then
    used, so that no other errors follow. definitions: the deck's own"""
    names = Names(definitions, {})
    for name, let in tuple(definitions.lets.items()):
        if let.default is not None:
            with suppress(Problem):  # of one of the two values, reported elsewhere
                old, new = names.evaluate(let.default), names.find(Name((let.name,), place_of(let.value)))
                before = complaints.error_count
                _check_alike(complaints, name, old, new, let.overrides[-1])
                if complaints.error_count > before:
                    definitions.lets[name] = replace(let, value=let.default, overrides=())


def _check_alike(
    complaints: Complaints, name: str, old: Value | ValueList, new: Value | ValueList, place: Place
) -> None:
    """Report a value of another dimension than the one that it overrides, given at a place."""
    if isinstance(old, Value) and isinstance(new, Value) and not units.same(old.dimension, new.dimension):
        complaints.add(_of_another_dimension(name, old, new, place))


def _without(axis: SweepAxis, paths: Collection[str]) -> SweepAxis:
    """The axis without the columns of these paths; of written rows that become equal, the first is kept, and so of
    Saltelli's, some of which differ in only one column."""
    columns = [column for column in axis.columns if column.path not in paths]
    if len(columns) == len(axis.columns) or axis.design not in ("", "saltelli") or not columns:
        return replace(axis, columns=tuple(columns))
    rows = zip(*map(compared_values, columns), strict=True)
    first = {row: number for number, row in reversed(list(enumerate(rows)))}
    return replace(axis, columns=tuple(_rows(column, sorted(first.values())) for column in columns))


def _rows(column: Column, rows: list[int]) -> Column:
    if isinstance(column, VariedPath):
        return replace(column, values=column.values[rows])
    return replace(column, options=tuple(column.options[row] for row in rows))


def destination(definitions: Definitions, entry: Setting) -> Destination:
    """The part of a deck that would hold this entry."""
    path = path_of(entry)
    if path in definitions.lets:
        return "let"
    values = List((entry.value,), place_of(entry.value))
    if entry.path[0].text in definitions.of_kind("servo"):
        of_sensor = len(entry.path) > 2 and entry.path[1].text == SENSOR
        words = of_sensor and decides_structure(definitions, path, values, Names(definitions, {}))
        return "servo" if len(entry.path) == 2 or words else "number"
    if len(entry.path) == 1:
        return "run" if path in (*OF_RUN, SEED) else "number"
    return "run" if decides_structure(definitions, path, values, Names(definitions, {})) else "number"


def applies_to(definitions: Definitions, run: Definition, entry: Setting) -> bool:
    """Return True if the run has the path's part of its structure, or if that is not known."""
    path, first = path_of(entry), entry.path[0].text
    block = definitions.block(run)
    if block is None or path in (*OF_RUN, *ONE_OF_TWO, SEED) or first == "rates":
        return True
    inside = entry.path[1].text
    if first == "environment":
        environment = block.get("environment")
        return len(entry.path) == 2 or (
            environment is not None and environment.body is not None and inside in environment.body.items
        )
    if inside in ("bed", "law"):
        return block.get(f"substitute {first}") is not None
    named = block.get("arm")
    arm = definitions.of_kind("arm").get(word_of(named.value) or "") if named is not None else None
    joints = definitions.block(arm) if arm is not None else None
    return joints is None or joints.get(f"joint {first}") is not None


def _of_another_dimension(path: str, old: Value, new: Value, defined: Place) -> Diagnostic:
    """The error for a setting without a unit (D060), or of another dimension than what it sets (D061)."""
    wanted, also = units.text(old.dimension), [Label(defined, "defined here")]
    if new.bare:
        number = "..." if isinstance(new.number, Scalar) else units.ONE.decimal(new.number)
        unit = old.unit.text if old.unit is not None else wanted
        message = f"`{path}` is in {wanted}, and this is a bare number"
        return error("D060", message, new.place, also=also, help=f"write `{number} {unit}`")
    is_in = "a pure number" if old.dimension == PURE else f"in {wanted}"
    dimension_words = "a pure number" if new.dimension == PURE else f"in {units.text(new.dimension)}"
    message = f"`{path}` is {is_in}, and this is {dimension_words}"
    return error("D061", message, new.place, also=also, help=unit_remedy(new, wanted, old.dimension))


def check_overridden(scope: Scope, run: Definition, made_here: Settings) -> None:
    """Report the run's entries without effect (D232). run: with the settings of its structure; made_here: by itself"""
    if not made_here.entries:
        return
    runs = scope.definitions.of_kind("run")
    bases = (runs[name].group.body for name in reversed(scope.definitions.homes(run)[:-1]) if name in runs)
    bodies = [run.group.body, *bases]
    settled = [*scope.parameters.values(), *scope.auxiliary.values()]
    for entry in made_here.entries:
        home = next(
            (index for index, body in enumerate(bodies) if any(other.place == entry.place for other in body)), 0
        )
        value = place_of(entry.value)
        replaced = {place for setting in settled if setting.origin.place == value for place in setting.origin.overrides}
        block = scope.definitions.block(run)
        replaced.update(_replaced_by(entry.place, block) if block is not None else ())
        replaced -= {setting.origin.place for setting in settled if setting.origin.place is not None}
        for index, body in enumerate(bodies[: home + 1]):
            for place in replaced.intersection(_places(body)):
                path = path_of(entry)
                scope.complaints.error(
                    "D232",
                    f"this counts for nothing: `with` sets `{path}`",
                    place,
                    also=[Label(entry.place, "set here")],
                    help="leave one of the two out"
                    if index == home
                    else f"write `with {path} = ...;` here, or leave it out",
                )


def _replaced_by(place: Place, block: MergedBlock) -> Iterator[Place]:
    """The places that an entry at this place has replaced in a block."""
    for item in block.items.values():
        if item.place == place:
            yield from item.overrides
        if item.body is not None:
            yield from _replaced_by(place, item.body)


def _places(entries: Iterable[Entry]) -> Iterator[Place]:
    """The places of all values that these entries write, except those set by `with`."""
    for entry in entries:
        if isinstance(entry, Group):
            yield from _places(entry.body)
        elif isinstance(entry, Setting) and WITH not in [word.text for word in entry.words]:
            yield entry.place
            yield from _places_in(entry.value)


def _places_in(expression: Expression) -> Iterator[Place]:
    """The places of an expression and of all its parts."""
    yield place_of(expression)
    if isinstance(expression, Call):
        yield from (word.place for word, _ in expression.named)
        yield from _places(expression.body or ())
    for child in children(expression):
        yield from _places_in(child)
