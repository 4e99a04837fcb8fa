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
    origin = diagnostic.at.place if diagnostic.at is not None else None
    shown_at = shown_place(origin) if origin is not None else None
    uri = address(shown_at.file) if shown_at is not None else None
    if shown_at is None or uri is None:
        shown_at = Place(deck, 1, 1, 0)
        uri = address(deck) or ""
    about = list(_related(diagnostic, shown_at))
    message = diagnostic.message
    if not related:
        message = "\n".join([message, *(_in_words(place, text, shown_at) for place, text in about)])
    editor_diagnostic = types.Diagnostic(
        range=texts.range(shown_at),
        message=message,
        severity=_SEVERITIES[diagnostic.severity],
        code=diagnostic.code,
        source=SOURCE,
        related_information=[
            types.DiagnosticRelatedInformation(
                types.Location(address(place.file) or uri, texts.range(place if address(place.file) else shown_at)),
                text,
            )
            for place, text in about
        ]
        if related
        else None,
    )
    return uri, editor_diagnostic


def _related(diagnostic: Diagnostic, shown_at: Place) -> Iterator[tuple[Place, str]]:
    """The places and words that a terminal prints below the message."""
    if diagnostic.at is not None:
        own_label = diagnostic.at
        if own_label.text:
            yield shown_at, own_label.text
        if own_label.place.expansions and shown_place(own_label.place) is not own_label.place:
            yield own_label.place, f"written here, in macro {own_label.place.expansions[0].macro}"
    for label in diagnostic.also:
        yield shown_place(label.place), label.text
    for text in diagnostic.help:
        yield shown_at, f"help: {text}"
    if diagnostic.at is not None:
        for step in diagnostic.at.place.expansions:
            yield step.use, f"note: in expansion of macro {step.macro}"
        for file, line, word in shown_place(diagnostic.at.place).came_by:
            yield (
                Place(file, line, 1, 1_000_000),
                "note: used here" if word == "used at" else "note: included from here",
            )


def _in_words(place: Place, text: str, shown_at: Place) -> str:
    return text if place == shown_at else f"{place}  {text}"
