"""A message to a user as data: what is wrong, at which places, and what to do."""

from __future__ import annotations

from typing import Literal

from met.frozen import frozen

Severity = Literal["error", "warning", "note"]


@frozen
class Place:
    """A stretch of one line of a source file.

    line and column count from 1; a column counts characters, not bytes. `expansions` is not empty for a token
    that a macro made: the token is then written at this place, in the macro's body or in an argument, and each
    expansion, innermost first, says through which macro it came and where that macro was used.
    `included` is the chain of `#include` lines that led to the file, innermost first.
    """

    file: str
    line: int
    column: int
    length: int = 1
    expansions: tuple[Expansion, ...] = ()
    included: tuple[tuple[str, int], ...] = ()

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@frozen
class Expansion:
    """One step of macro expansion: the macro's name and the place where it was used."""

    macro: str
    use: Place


@frozen
class Label:
    """A place and a few words about it, printed beside its caret."""

    place: Place
    text: str = ""


@frozen
class Diagnostic:
    """One message for a user: what is wrong, where, why, and what to do."""

    code: str
    message: str
    at: Label | None = None
    also: tuple[Label, ...] = ()
    help: tuple[str, ...] = ()
    severity: Severity = "error"
