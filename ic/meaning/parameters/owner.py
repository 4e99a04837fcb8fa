"""The owner of parameters, such as a joint's servo, and resolved parameters."""

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
