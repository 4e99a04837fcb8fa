"""Diagnostics: the one type of every message that a user sees, whoever noticed.

A diagnostic is a code, a severity, one sentence, the place it is about, other places involved, and the remedy.
Functions that find a user's mistake raise `Problem` (carrying one or more); the command line catches it, renders
it once and exits with 2. Nothing else is an acceptable way to refuse input.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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


class Problem(Exception):
    """Raised for a user's mistake; carries diagnostics, never a traceback's worth of program.

    sources: file -> text, for those who show the lines that the diagnostics are about; may be empty.
    """

    def __init__(
        self, diagnostics: Diagnostic | Iterable[Diagnostic], sources: Mapping[str, str] | None = None
    ) -> None:
        self.sources: Mapping[str, str] = dict(sources or {})
        self.diagnostics: tuple[Diagnostic, ...] = (
            (diagnostics,) if isinstance(diagnostics, Diagnostic) else tuple(diagnostics)
        )
        super().__init__("; ".join(f"{d.code}: {d.message}" for d in self.diagnostics))

    def __str__(self) -> str:
        """The messages in one line; where the sources are known, as the command line prints them.

        So the traceback in a notebook ends in the deck's line with its caret.
        """
        if not self.sources:
            helps = (f"\n  {text}" for each in self.diagnostics for text in each.help)
            return super().__str__() + "".join(helps)
        from met.messages.render import render

        return "\n" + render(self.diagnostics, self.sources).rstrip("\n")


def error(
    code: str,
    message: str,
    at: Label | Place | None = None,
    *,
    also: Iterable[Label] = (),
    help: Iterable[str] | str = (),
) -> Diagnostic:
    """A `Diagnostic` of severity error, with a bare place allowed for a label and one string for the helps."""
    label = Label(at) if isinstance(at, Place) else at
    helps = (help,) if isinstance(help, str) else tuple(help)
    return Diagnostic(code, message, label, tuple(also), helps)


def nearest(word: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The known word that is most like this one; None where none is `cutoff` like it (1 is the same word)."""
    import difflib  # only who made a mistake pays for it

    close = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return close[0] if close else None


def meant(word: str, known: Iterable[str]) -> str | None:
    """The known word that this one may have been meant for, capitals or not; or none."""
    folded = {candidate.lower(): candidate for candidate in dict.fromkeys(known)}
    close = nearest(word.lower(), folded)
    return folded[close] if close is not None else None


def did_you_mean(word: str, known: Iterable[str]) -> tuple[str, ...]:
    """The help line that offers the word that may have been meant; or none."""
    close = meant(word, known)
    return (f"did you mean `{close}`?",) if close is not None else ()
