"""Keys of a run that a plan keeps as one word or number each, declared once: at the field that keeps them.

The declaration determines the key in decks (its type, unit, bounds and default), the output of `met explain` and `met
plan`, and the meaning of an older plan that lacks it. The deck language refers to it, and adds its syntax and whether a
sweep may choose it (`ic.language.runs`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from met.frozen import RUN_KEY, frozen, keyed
from met.parameter import Parameter


@frozen(kw_only=True)
class RunKey:
    """A key of a run, of its `environment` or of its `initial`.

    path       what sweeps, `--set` and `met explain` call it: `environment.velocity_products`
    parameter  its type, unit, bounds, default and meaning: a word, or a number that decides the program
    true       of a key of two words: the one that the plan keeps as True; "" where it keeps the word or the number
    listed     whether `met plan` lists it where it is not the default; False where another line says it
    """

    path: str
    parameter: Parameter
    true: str = ""
    listed: bool = True

    def in_plan(self, written: str | float) -> Any:
        """The plan's value for the deck's value, in SI."""
        if self.true:
            return written == self.true
        return int(written) if self.parameter.whole else written

    def in_deck(self, value: Any) -> str | float:
        """Return the deck's value, in SI, for the plan's value."""
        if self.true:
            return next(word for word in self.parameter.words if (word == self.true) is value)
        return value if isinstance(value, str) else float(value)


def run_key(key: RunKey) -> Any:
    """A field of a plan's dataclass that keeps this key. In a plan without it the default holds, and the keys of
    structures do not change."""
    default = key.parameter.default
    assert isinstance(default, str | float | int)  # older plans without the key need a default
    return keyed("where set", default=key.in_plan(default), run_key=key)


def run_keys(cls: type) -> Iterator[tuple[str, RunKey]]:
    """The fields of a plan's dataclass that keep keys of a run, by name, with what they keep."""
    for field in dataclasses.fields(cls):
        if RUN_KEY in field.metadata:
            yield field.name, field.metadata[RUN_KEY]


VELOCITY_PRODUCTS = RunKey(
    path="environment.velocity_products",
    parameter=Parameter(
        name="velocity_products",
        shape="word",
        words=("on", "off"),
        default="on",
        doc="whether Coriolis, centrifugal and gyroscopic torques act",
    ),
    true="on",
    listed=False,
)
BALANCED = RunKey(
    path="initial.servos",
    parameter=Parameter(
        name="servos",
        shape="word",
        words=("unloaded", "balanced"),
        default="unloaded",
        doc="`balanced`: servos begin in equilibrium, so that their joints do not accelerate; `unloaded`: with zero "
        "current, zero integral and an unloaded gear",
    ),
    true="balanced",
)
