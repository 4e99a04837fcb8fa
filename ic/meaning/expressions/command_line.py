"""Numbers from outside of a deck, in place of its own, and their origins."""

from __future__ import annotations

from ic.grammar.syntax import Expression, Setting
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value, no_single_number
from ic.text.lexer import COMMAND_LINE
from met.diagnostic import Place
from met.frozen import frozen
from met.plan import Origin

ON_COMMAND_LINE = "set on the command line"
"""The note of such an origin."""


@frozen
class CommandLineValue:
    """A number that `--set`, or a run, puts in place of a deck's: its value, and the expression as written.

    overrides  places of what it replaced of its kind, latest first
    """

    path: str
    value: Value
    expression: Expression
    overrides: tuple[Place, ...] = ()

    def overriding(self, origin: Origin) -> Origin:
        """The origin of a value that this one overrides, made its own."""
        places = (origin.place,) if origin.place is not None else ()
        return written_origin(self.value.place, (*self.overrides, *places, *origin.overrides))


def is_on_command_line(place: Place | None) -> bool:
    """Return True if a place is on the command line, but not in the body of a macro of -D."""
    return place is not None and place.file == COMMAND_LINE and not place.expansions


def written_origin(place: Place, overrides: tuple[Place, ...], note: str = "") -> Origin:
    """The origin of a value that is written at a place, in the deck or outside of it."""
    return Origin("deck", place, overrides, ON_COMMAND_LINE if is_on_command_line(place) else note)


def evaluate_setting(entry: Setting, path: str, names: Names) -> CommandLineValue:
    """The number that an entry sets. Raises Problem where it is not a number."""
    value = names.evaluate(entry.value)
    if not isinstance(value, Value):
        raise no_single_number(f"`{path}`", value)
    return CommandLineValue(path, value, entry.value, entry.overrides)
