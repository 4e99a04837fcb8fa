"""The call in whose parentheses a cursor stands, and the argument that is written there."""

from __future__ import annotations

from collections.abc import Sequence

from ic.meaning.mechanics.matter import SHAPES
from met import models
from met.frozen import frozen
from met.parameter import Parameter
from met.plan.channel import COMMAND_UNIT

_OPEN, _CLOSED = ("(", "[", "{"), (")", "]", "}")

WATCHES = Parameter(name="of", doc="what the metric watches: a channel, such as `JOINT.q`")
"""The argument of a metric that its model does not declare."""


@frozen
class OpenCall:
    """A call whose parenthesis no word before the cursor closes.

    name        the function, model or shape
    argument    the argument whose value is written, `radius` in `cylinder(radius = `; "" where a name may stand
    earlier     the arguments that are written before it
    parameters  those that it takes by name; none of a function
    """

    name: str
    argument: str
    earlier: tuple[str, ...]
    parameters: tuple[Parameter, ...]

    @property
    def wanted(self) -> Parameter | None:
        """The parameter whose value is written."""
        return next((parameter for parameter in self.parameters if parameter.name == self.argument), None)


def open_call(texts: Sequence[str]) -> OpenCall | None:
    """The innermost call that the words of an entry, those before a cursor, leave open; None outside of calls."""
    depth, opened = 0, len(texts) - 1
    while opened >= 0 and not (texts[opened] == "(" and depth == 0):
        depth += (texts[opened] in _CLOSED) - (texts[opened] in _OPEN)
        opened -= 1
        depth = max(depth, 0)  # a bracket that is open, as in `size = [1, `
    if opened < 1:
        return None
    depth, argument, arguments = 0, "", []
    for n in range(opened + 1, len(texts)):
        word = texts[n]
        depth += (word in _OPEN) - (word in _CLOSED)
        if depth == 0 and word == "=":
            argument = texts[n - 1]
        elif depth == 0 and word in (",", ";"):
            arguments.append(argument)
            argument = ""
    name = texts[opened - 1]
    return OpenCall(name, argument, tuple(arguments), _parameters(name, texts[0]))


def ends_a_model(texts: Sequence[str]) -> bool:
    """True where the last word closes a call that is not a number: of a model, of a shape, of a kind of command."""
    call = open_call(texts[:-1]) if texts[-1:] == [")"] else None
    return call is not None and (call.name in COMMAND_UNIT or bool(call.parameters))


def _parameters(name: str, entry: str) -> tuple[Parameter, ...]:
    """The arguments of a call in an entry that begins with this word: `max` is a metric, and a function elsewhere."""
    if entry == "shape":
        return SHAPES[name].parameters if name in SHAPES else ()
    metric = models.available("metric").get(name)
    if metric is not None and entry == "metric":
        return (WATCHES, *models.written(metric))
    for kind in models.GROUPS:
        model = models.available(kind).get(name)
        if model is not None:
            return models.written(model)
    return ()
