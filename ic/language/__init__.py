"""The deck language, declared: every block, and what may stand in it.

The compiler's checks and suggestions, `met doc`, the tables of docs/deck.md, the grammars for editors and the paths of
sweeps are made of these declarations. A key more is an `Entry` more, and the code that carries it out.
"""

from __future__ import annotations

from ic.language.bodies import ARM, JOINT, LINK, PAYLOAD
from ic.language.declaration import Block, Entry
from ic.language.runs import ENVIRONMENT, INITIAL, RATES, RUN, SUBSTITUTE, SWEEP, TOLERANCES
from ic.language.servos import SERVO

BLOCKS = {
    block.name: block
    for block in (
        ARM, LINK, JOINT, SERVO, RUN, RATES, INITIAL, ENVIRONMENT, PAYLOAD, SUBSTITUTE, TOLERANCES, SWEEP
    )
}  # fmt: skip
"""All blocks, by name, in the order in which a reader meets them."""

DEFINITIONS = tuple(block.name for block in BLOCKS.values() if not block.within)
"""The words that definitions of a deck begin with."""

HEADS = (*dict.fromkeys(
    entry.path.partition(".")[0] for block in BLOCKS.values() for entry in block.entries
    if entry.path.partition(".")[0] not in ("", "JOINT", "SERVO") and "." in entry.path
),)  # fmt: skip
"""The first words of paths that no name of a deck's may be."""

__all__ = ["BLOCKS", "DEFINITIONS", "HEADS", "Block", "Entry"]
