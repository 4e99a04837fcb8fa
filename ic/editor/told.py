"""Diagnostics in an editor's form: in the words of `met check`, with helps and notes as related information."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

from lsprotocol import types

from ic.editor.positions import Texts
from met.diagnostic import Diagnostic, Place
from met.messages.message import shown_place

SOURCE = "met"

_SEVERITIES: Mapping[str, types.DiagnosticSeverity] = MappingProxyType({
    "error": types.DiagnosticSeverity.Error,
    "warning": types.DiagnosticSeverity.Warning,
    "note": types.DiagnosticSeverity.Information,
})  # fmt: skip


def in_editor(
    diagnostic: Diagnostic, deck: str, texts: Texts, address: Callable[[str], str | None], related: bool
) -> tuple[str, types.Diagnostic]:
    """The address of the file that a diagnostic is shown in, and what is shown.

    deck     the name of the deck's file, at whose beginning stands what has no place in a file
    address  of the file of that name; None for the command line
    related  whether the editor shows what is related; where not, it is in the message, as a terminal has it
    """
    at = diagnostic.at.place if diagnostic.at is not None else None
    shown = shown_place(at) if at is not None else None
    uri = address(shown.file) if shown is not None else None
    if shown is None or uri is None:
        shown = Place(deck, 1, 1, 0)
        uri = address(deck) or ""
    about = list(_related(diagnostic, shown))
    message = diagnostic.message
    if not related:
        message = "\n".join([message, *(_in_words(place, text, shown) for place, text in about)])
    made = types.Diagnostic(
        range=texts.range(shown),
        message=message,
        severity=_SEVERITIES[diagnostic.severity],
        code=diagnostic.code,
        source=SOURCE,
        related_information=[
            types.DiagnosticRelatedInformation(
                types.Location(address(place.file) or uri, texts.range(place if address(place.file) else shown)), text
            )
            for place, text in about
        ]
        if related
        else None,
    )
    return uri, made


def _related(diagnostic: Diagnostic, shown: Place) -> Iterator[tuple[Place, str]]:
    """The places and words that a terminal prints below the message."""
    if diagnostic.at is not None:
        at = diagnostic.at
        if at.text:
            yield shown, at.text
        if at.place.expansions and shown_place(at.place) is not at.place:
            yield at.place, f"written here, in macro {at.place.expansions[0].macro}"
    for label in diagnostic.also:
        yield shown_place(label.place), label.text
    for text in diagnostic.help:
        yield shown, f"help: {text}"
    if diagnostic.at is not None:
        for step in diagnostic.at.place.expansions:
            yield step.use, f"note: in expansion of macro {step.macro}"
        for file, line, word in shown_place(diagnostic.at.place).came_by:
            yield (
                Place(file, line, 1, 1_000_000),
                "note: used here" if word == "used at" else "note: included from here",
            )


def _in_words(place: Place, text: str, shown: Place) -> str:
    return text if place == shown else f"{place}  {text}"
