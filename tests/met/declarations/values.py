"""What a declaration allows and forbids a parameter to be, and where its numbers stand in a plan."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ic.driver.compile import Compiled
from met.diagnostic import Diagnostic
from met.parameter import Parameter
from tests.met.small_models import Use, Value

NUMBERS = ("number", "vector", "list")
"""Shapes that are made of numbers."""


def holds(parameter: Parameter, value: float) -> bool:
    """Whether a number is within the declared range."""
    return (
        (parameter.above is None or value > parameter.above)
        and (parameter.at_least is None or value >= parameter.at_least)
        and (parameter.below is None or value < parameter.below)
        and (parameter.at_most is None or value <= parameter.at_most)
        and (not parameter.whole or value == round(value))
    )


def bounds(parameter: Parameter) -> Iterator[tuple[float, float, str]]:
    """(inside, outside, words that a message has of it): each bound with the numbers on its two sides."""
    up, down = math.inf, -math.inf
    # a whole number's neighbours are whole, so that one bound alone is broken
    next_up, next_down = (
        ((lambda x: x + 1.0), (lambda x: x - 1.0))
        if parameter.whole
        else ((lambda x: math.nextafter(x, up)), (lambda x: math.nextafter(x, down)))
    )
    if parameter.above is not None:
        yield next_up(parameter.above), parameter.above, f"above {parameter.above:g}"
    if parameter.at_least is not None and (parameter.above is None or parameter.above < parameter.at_least):
        yield parameter.at_least, next_down(parameter.at_least), f"at least {parameter.at_least:g}"
    if parameter.below is not None:
        yield next_down(parameter.below), parameter.below, f"below {parameter.below:g}"
    if parameter.at_most is not None:
        yield parameter.at_most, next_up(parameter.at_most), f"at most {parameter.at_most:g}"
    if parameter.whole:
        inside = inner(parameter)
        yield inside, math.nextafter(inside, up), "whole"


def inner(parameter: Parameter) -> float:
    """A number well inside the range."""
    edges = (parameter.above, parameter.at_least, parameter.below, parameter.at_most)
    known = [x for x in edges if x is not None]
    tries = (1.0, 0.5, sum(known) / max(len(known), 1), *(x + d for x in known for d in (1.0, -1.0)))
    return next(x for x in tries if holds(parameter, x))


def shaped(parameter: Parameter, use: Use, number: float) -> Value:
    """A value of the parameter's shape with this number in it, the last one of several."""
    if parameter.shape == "number":
        return number
    of = parameter.as_many_as or parameter.name
    count = 3 if parameter.shape == "vector" else len(use.values.get(of, (0.0,)))
    return (inner(parameter),) * (count - 1) + (number,)


def constant(parameter: Parameter) -> bool:
    """Whether it has numbers that no case varies, nor the command line."""
    return parameter.shape == "list" or parameter.decides


def several(value: Value | None) -> tuple[float | str | None, ...]:
    """The numbers of a value, one or more."""
    return value if isinstance(value, tuple) else (value,)


def paths(use: Use, parameter: Parameter) -> list[str]:
    """Where the parameter's numbers stand in a plan."""
    path = use.path(parameter)
    return [f"{path}.{axis}" for axis in "xyz"] if parameter.shape == "vector" else [path]


def varied(use: Use, parameter: Parameter) -> list[str]:
    """What a sweep or the command line calls its numbers: of all joints at once, where the deck writes them so."""
    head = f"{use.head}.{use.key(parameter)}"
    return [head + path.removeprefix(use.path(parameter)) for path in paths(use, parameter)]


def errors(found: Compiled) -> list[Diagnostic]:
    """What stands in the way of a plan."""
    return [each for each in found.diagnostics if each.severity == "error"]
