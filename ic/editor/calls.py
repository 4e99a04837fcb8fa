"""The call in whose parentheses a cursor stands, and which of its arguments is written there."""

from __future__ import annotations

from collections.abc import Sequence

from ic.meaning.mechanics.shapes import SHAPES
from met import models
from met.frozen import frozen
from met.parameter import Parameter

_OPEN, _CLOSED = ("(", "[", "{"), (")", "]", "}")

WATCHES = Parameter(name="of", doc="what the metric watches: a channel, such as `JOINT.q`")
"""The argument of a metric that its model does not declare."""


@frozen
class OpenCall:
    """A call whose parenthesis no word before the cursor closes.

    name        the function, model or shape
    argument    the argument whose value is written, `radius` in `cylinder(radius = `; "" where a name may stand
    given       the arguments that are written before it
    parameters  those that it takes by name; none of a function
    """

    name: str
    argument: str
    given: tuple[str, ...]
    parameters: tuple[Parameter, ...]

    @property
    def wanted(self) -> Parameter | None:
        """The parameter whose value is written."""
        return next((each for each in self.parameters if each.name == self.argument), None)


def open_call(texts: Sequence[str], of_shape: bool = False) -> OpenCall | None:
    """The innermost call that the words of an entry, those before a cursor, leave open; None outside of any.

    of_shape  whether the entry is the shape of a link
    """
    depth, opened = 0, len(texts) - 1
    while opened >= 0 and not (texts[opened] == "(" and depth == 0):
        depth += (texts[opened] in _CLOSED) - (texts[opened] in _OPEN)
        opened -= 1
        depth = max(depth, 0)  # a bracket that is open, as in `size = [1, `
    if opened < 1:
        return None
    depth, argument, given = 0, "", []
    for n in range(opened + 1, len(texts)):
        word = texts[n]
        depth += (word in _OPEN) - (word in _CLOSED)
        if depth == 0 and word == "=":
            argument = texts[n - 1]
        elif depth == 0 and word in (",", ";"):
            given.append(argument)
            argument = ""
    name = texts[opened - 1]
    return OpenCall(name, argument, tuple(given), _parameters(name, of_shape))


def _parameters(name: str, of_shape: bool) -> tuple[Parameter, ...]:
    if of_shape:
        return SHAPES[name].parameters if name in SHAPES else ()
    for kind in models.GROUPS:
        model = models.available(kind).get(name)
        if model is not None:
            return (WATCHES, *models.written(model)) if kind == "metric" else models.written(model)
    return ()
