"""Options of commands that take a quantity: a number with its unit, such as `2 s`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import click


class QuantityOption(click.ParamType):
    """An option's number with its unit, such as `90 s`, which is read as SI; a bare number is SI already.

    kind    what it is, in words: "time";  unit: SI
    write   what to write instead of a text that is none;  words: the same for texts that may be tried here, by text
    suits   False for a number that is out of bounds;  beyond: what to say of that one
    """

    name = "quantity"

    def __init__(
        self,
        kind: str,
        unit: str,
        write: str,
        *,
        suits: Callable[[float], bool] = lambda number: True,
        beyond: str = "",
        **words: str,
    ) -> None:
        self.kind, self.unit, self.write, self.words = kind, unit, write, words
        self.suits, self.beyond = suits, beyond

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read the number as SI. Raises a usage error for a text that is none, or that does not suit."""
        try:
            number = measured(value, self.unit)
        except ValueError:
            helps = self.words.get(str(value), f"write {self.write}")
            self.fail(f"`{value}` is no {self.kind}: {helps}", param, ctx)
        if not self.suits(number):
            self.fail(f"`{value}` is no {self.kind} {self.beyond}", param, ctx)
        return number


def measured(value: Any, si: str) -> float:
    """A number with or without a unit, in SI. si: the unit to assume without one. Raises ValueError."""
    from met import units
    from met.unit_parser import parse_unit

    split = re.fullmatch(r"([-+.\deE]*\d\.?)\s*(\D*)", str(value).strip())
    number, unit = split.groups() if split else ("", "")
    number_in_si = float(number) * (parse_unit(unit).scale if unit else 1.0)
    if unit and not units.same(parse_unit(unit).dimension, parse_unit(si).dimension):
        raise ValueError
    return number_in_si


SECONDS = QuantityOption(
    "time", "s", "`90 s`, `5 min` or `1.5 h`", suits=lambda s: 0.0 < s < math.inf, beyond="to wait for"
)
INSTANT = QuantityOption("instant", "s", "`2 s` or `250 ms`")
