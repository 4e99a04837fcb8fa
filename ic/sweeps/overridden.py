"""Entries of a run without effect, since the same run, or one that it is like, sets their values by `with`.

An entry of a run that is further out, and a general one of which other parameters take their value (`q = 0 rad;` and
`with initial.hinge.q = 1 rad;`), may stand.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ic.grammar.settings import path_of
from ic.grammar.syntax import Call, Entry, Expression, Group, Setting, children, place_of
from ic.meaning.definitions.merge import WITH, MergedBlock
from ic.meaning.definitions.resolve import Definition
from ic.meaning.parameters.scope import Scope
from ic.sweeps.settings import Settings
from met.diagnostic import Label, Place


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
    yield place_of(expression)
    if isinstance(expression, Call):
        yield from (word.place for word, _ in expression.named)
        yield from _places(expression.body or ())
    for child in children(expression):
        yield from _places_in(child)
