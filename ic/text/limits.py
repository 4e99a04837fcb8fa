"""Limits of a deck: a hostile or broken one ends in a diagnostic, soon and in little memory.

Each limit is far above what a deck written by hand needs (the standard library's largest file has some thousand
tokens) and far below what would hurt.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

from ic.text.complaints import Complaints
from met.diagnostic import Diagnostic

MOST_BYTES = 2 << 20  # of one file
MOST_TOKENS = 500_000  # of all files together, white space included
MOST_URDF_BYTES = 8 << 20  # of one URDF or MJCF file
MOST_MESH_BYTES = 64 << 20  # of one mesh, and of all that the bodies of one MJCF file have their mass from
MOST_ELEMENTS = 50_000  # of one XML file
MOST_LINKS = 1_000  # of one robot
XML_DEPTH = 40  # of elements within each other
MJCF_DEPTH = 200  # the same where bodies are within each other, as in MJCF
LONGEST_LINE = 200_000  # characters
MOST_INCLUDES = 2_000  # files entered, again and again counted
INCLUDE_DEPTH = 50
MOST_USED = 100  # decks under roofs, those of used decks counted
MOST_MACRO_BODY = 4_096  # tokens
MOST_ARGUMENTS = 20_000  # tokens in one macro call
MACRO_DEPTH = 64  # macros through which one token may come; calls within arguments of calls
MOST_FROM_ONE_USE = 100_000  # tokens
MOST_EXPANDED = 500_000  # tokens
MOST_ITERATIONS = 10_000  # of one loop
MOST_LOOPED = 500_000  # tokens of all iterations of all loops
MOST_CONDITIONS = 10_000  # that are evaluated
CONDITION_DEPTH = 100  # of `#if` within each other in one file
MOST_TERMS = 2_000  # tokens in one condition
CONDITION_NESTING = 32  # parentheses, signs and choices within each other in one condition
LONGEST_NAME = 256  # characters
LONGEST_STRING = 4_096
LONGEST_NUMBER = 64
DEPTH = 40  # braces, brackets and parentheses within each other
MOST_OPERATORS = 100  # in one expression
MOST_ERRORS = 30  # then reading stops: the rest would seldom say more


class GiveUp(Exception):
    """Ends the reading of a deck at once; messages have been noted."""


class Findings(Complaints):
    """Diagnostics of one reading. A mistake in a macro's body is reported once, not at every use."""

    def __init__(self) -> None:
        super().__init__()
        self._reported: set[tuple[object, ...]] = set()
        self._errors = 0

    def add(self, *diagnostics: Diagnostic) -> None:
        """Add diagnostics, each once. Raises GiveUp after `MOST_ERRORS` errors (D018)."""
        for diagnostic in diagnostics:
            place = diagnostic.at.place if diagnostic.at else None
            key = (diagnostic.code, diagnostic.message, place and (place.file, place.line, place.column))
            if self.is_of_another_iteration(diagnostic) or key in self._reported:
                continue
            self._reported.add(key)
            super().add(diagnostic)
            self._errors += diagnostic.severity == "error"
            if self._errors >= MOST_ERRORS:
                super().add(Diagnostic("D018", f"more than {MOST_ERRORS} errors: the rest of the deck was not read"))
                raise GiveUp


@contextmanager
def without_collection() -> Iterator[None]:
    """Turn the cyclic garbage collector off: a large deck makes many objects and no cycles; it took half the time."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
