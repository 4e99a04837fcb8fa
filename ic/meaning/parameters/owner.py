"""The owner of parameters, such as a joint's servo; resolved parameters; and reasons why a path cannot vary."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from ic.grammar.syntax import Expression
from ic.language.unit_words import unit_here
from met.diagnostic import Place
from met.frozen import frozen
from met.parameter import Parameter
from met.plan import JointKind, Origin
from met.trace import Real
from met.units import Dimension

XYZ = ("x", "y", "z")


@frozen
class Owner:
    """The owner of parameters: its name in words, its place, and the first part of its parameters' paths.

    homes    definitions under which a parameter that nobody wrote is reached
    local    first part of the path under a definition's name
    joint, command, of   what the words `joint`, `effort`, `command`, `of` in declared units mean here
    """

    label: str
    place: Place
    path: str
    homes: tuple[str, ...] = ()
    local: str | None = None
    joint: JointKind = "revolute"
    command: str | None = None
    of: str | None = None
    called: str | None = None  # what to call its one parameter, which has no name in the deck
    others: tuple[Parameter, ...] = ()  # all that its model declares, where it is a model
    call: bool = False  # whether its parameters stand in parentheses, as in `rod(length = 1 m, along = x)`
    short: str = ""  # the parameter that a path may leave out: `environment.gravity.x` for `environment.gravity.g.x`

    def as_written_in(self, homes: Sequence[str]) -> Owner:
        """The owner of a value that the first of these definitions writes, and the others inherit with `like`: its
        label names the one that writes it."""
        label = self.label
        if homes and self.homes and homes[0] != self.homes[-1]:
            label = label.replace(f"servo `{self.homes[-1]}`", f"servo `{homes[0]}`")
        elif tuple(homes) == self.homes:
            return self
        return replace(self, label=label, homes=tuple(homes))

    def what(self, wanted: Parameter) -> str:
        return self.called or f"`{wanted.name}` of {self.label}"

    def unit(self, wanted: Parameter) -> tuple[str, Dimension]:
        """The SI unit of a parameter here, as text and as dimension."""
        return unit_here(wanted.unit, self.joint, self.command, self.of)

    def join(self, name: str) -> str:
        return f"{self.path}.{name}" if self.path else name

    def paths(self, name: str, homes: Iterable[str]) -> tuple[str, ...]:
        """Every path of a parameter: its own first, then those under definitions."""
        names = [name, name.removeprefix(f"{self.short}.")] if self.short else [name]
        paths = [
            path for other in names for path in (self.join(other), *(self.join_local(home, other) for home in homes))
        ]
        return tuple(dict.fromkeys(paths))

    def join_local(self, home: str, name: str) -> str:
        local = self.path if self.local is None else self.local
        return ".".join(part for part in (home, local, name) if part)


@dataclass
class Settled:
    """A parameter as it goes to the plan, but with a recorded scalar where the plan has a formula; and what it means.

    Scopes share those of links, joints and servos that are as written: once settled there, none is changed.

    expression  what the deck wrote, None where it wrote nothing
    """

    value: Real | tuple[float, ...] | str
    unit: str
    origin: Origin
    doc: str = ""
    expression: Expression | None = None

    def __copy__(self) -> Settled:
        """A copy, in a third of the time of the default `copy`: long arms have thousands."""
        copied = object.__new__(Settled)
        copied.__dict__.update(self.__dict__)
        return copied


A_RUN_FOR_EACH = "write a run for each, `like` the first, and `sweep NAME = ONE + OTHER;`"

BY_MACRO = "write a name in its place in the deck, and give its value by `-D NAME=VALUE`"


@frozen
class NotSweepable:
    """A path that is known and cannot vary over numbers.

    reason  what it is, to go on after "it"
    sweep   what a sweep writes instead; "" where it varies over choices, by its own path
    one_of  the numbers that it is made of, any of which varies and can be set, in words; "" of what has none
    setting what to do where it is to be set from the command line and has no such numbers
    """

    reason: str
    sweep: str = ""
    one_of: str = ""
    setting: str = BY_MACRO

    @property
    def is_choice(self) -> bool:
        """Return True if a sweep may choose among its values, each of which makes a program of its own."""
        return not self.sweep and not self.one_of

    def to_vary(self, path: str) -> str:
        """The help for varying it."""
        if self.one_of:
            return f"it {self.reason}; vary {self.one_of}"
        return f"it {self.reason}: {self.sweep or f'write `vary {path} = [...];`'}"

    def to_set(self) -> str:
        """The help for setting it from the command line."""
        if self.one_of:
            return f"it {self.reason}; set {self.one_of}"
        return f"it {self.reason}: {self.setting}"


DECIDES = "decides the program"

COMPILED = NotSweepable(DECIDES)
"""A compile-time constant: another value is another program."""

COMPILED_ALONE = NotSweepable(DECIDES, A_RUN_FOR_EACH)
"""A compile-time constant that no sweep can choose."""

LIST = NotSweepable("is a list", A_RUN_FOR_EACH, setting="write it in the deck as a `let`, which can be set")
WORD = NotSweepable("is a word", "vary it over words")
OF_A_FILE = NotSweepable("is read from a file", "it is one for the whole sweep")


def several(paths: Sequence[str]) -> NotSweepable:
    """The reason for a path that is made of several numbers, which have these paths."""
    return NotSweepable(f"is made of {len(paths)} numbers", one_of=f"one of them: {_listed(paths)}")


def follows(other: str, paths: Sequence[str]) -> NotSweepable:
    """The reason for a path that follows from another one, made of numbers with these paths."""
    return NotSweepable(f"follows from `{other}`", one_of=f"one of: {_listed(paths)}")


def a_model(kind: str, path: str) -> NotSweepable:
    """The reason for a model, `kind` in words, whose parameters vary."""
    parameter = f"a parameter of it, `{path}.PARAMETER`"
    return NotSweepable(f"is {kind}", f"vary {parameter}", setting=f"set {parameter}")


def chosen(path: str, choices: str) -> NotSweepable:
    """The reason for what a sweep chooses by another `path`, over `choices` in words, and what is set by it."""
    return NotSweepable(DECIDES, f"vary `{path}` over {choices}", setting=f"set `{path}`")


def _listed(paths: Sequence[str]) -> str:
    return ", ".join(f"`{path}`" for path in paths)
