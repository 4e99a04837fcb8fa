"""Diagnostics: the one type of every message that a user sees, from whichever part of MET.

A diagnostic is a code, a severity, one sentence, the place it is about, other places involved, and the remedy.
Functions that find a user's mistake raise `Problem` (carrying one or more); the command line catches it, renders
it once and exits with 2. Nothing else is an acceptable way to refuse input.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from met.messages.message import (
    Diagnostic,
    Expansion,
    Help,
    Label,
    Place,
    Severity,
    TextChange,
    did_you_mean,
    leave_out,
    meant,
    nearest,
    write,
    write_either,
)

__all__ = [
    "Diagnostic",
    "Expansion",
    "Help",
    "Label",
    "Place",
    "Problem",
    "Severity",
    "TextChange",
    "did_you_mean",
    "error",
    "leave_out",
    "meant",
    "nearest",
    "warning",
    "write",
    "write_either",
]


class Problem(Exception):
    """Raised for a user's mistake; carries diagnostics and is shown without a traceback.

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
            helps = (f"\n  {text}" for diagnostic in self.diagnostics for text in diagnostic.help)
            return super().__str__() + "".join(helps)
        from met.messages.render import render

        return render(self.diagnostics, self.sources).rstrip("\n")


def error(
    code: str,
    message: str,
    at: Label | Place | None = None,
    *,
    also: Iterable[Label] = (),
    help: Iterable[str] | str = (),
) -> Diagnostic:
    """A `Diagnostic` of severity error; `at` may be a bare place instead of a label, and `help` one string."""
    label = Label(at) if isinstance(at, Place) else at
    helps = (help,) if isinstance(help, str) else tuple(help)
    return Diagnostic(code, message, label, tuple(also), helps)


def warning(
    code: str, message: str, at: Label | Place | None, *, also: Iterable[Label] = (), help: Iterable[str]
) -> Diagnostic:
    """A `Diagnostic` of severity warning, with the arguments of `error`."""
    return replace(error(code, message, at, also=also, help=help), severity="warning")
