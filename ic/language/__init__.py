"""The declaration of the deck language: every block with its entries.

The compiler's checks and suggestions, `met doc`, the tables of docs/deck.md, the grammars for editors and the paths of
sweeps are made of these declarations. A new key needs an `Entry`, and the code that carries it out.
"""

from __future__ import annotations

from ic.language.bodies import ARM, BOOM, JOINT, LINK, LOOP, PAYLOAD
from ic.language.declaration import BlockDeclaration, Entry
from ic.language.runs import (
    ENVIRONMENT,
    INITIAL,
    LINEAR,
    METRIC,
    RATES,
    RUN,
    SCALE,
    SEARCH,
    SUBSTITUTE,
    SWEEP,
    TOLERANCES,
    TUNE,
)
from ic.language.top_level import ANYWHERE, SERVO, TOP_LEVEL

BLOCKS = {
    block.name: block
    for block in (
        ARM, LINK, BOOM, JOINT, LOOP, SERVO, RUN, RATES, INITIAL, ENVIRONMENT, PAYLOAD, SUBSTITUTE, SCALE, METRIC,
        LINEAR, TOLERANCES, SWEEP, SEARCH, TUNE,
    )
}  # fmt: skip
"""All blocks, by name, in the order in which a reader meets them."""

DEFINITIONS = tuple(block.name for block in BLOCKS.values() if not block.within)
"""The words that definitions of a deck begin with."""

OF_A_RUN = ("sweep", "search", "tune")
"""The definitions that are `of` a run."""

EXPERIMENTS = ("run", *OF_A_RUN)
"""The definitions that have cases to run; they share one space of names."""

NAMED = ("JOINT", "LOOP", "SERVO")
"""Placeholders at the start of a declared path, which stand for a name of the deck's."""

HEADS = tuple(
    sorted(
        {
            entry.path.partition(".")[0] for block in BLOCKS.values() for entry in block.entries if "." in entry.path
        }.difference(NAMED)
    )
)
"""The first words of paths in a run that are not names of joints, arms or servos."""


def choices(head: str) -> tuple[str, ...]:
    """The entries that a sweep may choose under this first word of a path, such as `JOINT`, `SERVO` or `rates`; under
    "", whole paths of one word."""
    entries = (entry for block in BLOCKS.values() for entry in block.entries if entry.varies == "choice")
    split = (entry.path.rpartition(".") for entry in entries)
    return tuple(last for first, _, last in split if first == head)


__all__ = [
    "ANYWHERE",
    "BLOCKS",
    "DEFINITIONS",
    "EXPERIMENTS",
    "HEADS",
    "OF_A_RUN",
    "TOP_LEVEL",
    "BlockDeclaration",
    "Entry",
    "choices",
]
