"""Diagnostics in an editor's form: in the words of `met check`, with helps and notes as related information.

Edits of helps are quick fixes, where the text is still the checked one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType

from lsprotocol import types

from ic.editor.positions import Texts
from met.diagnostic import Diagnostic, Place
from met.frozen import frozen
from met.messages.edits import Edit
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


@frozen
class QuickFix:
    """An edit that carries out the help of a diagnostic, as an editor offers it.

    file   the address of the file that it changes
    alone  whether it is the only one of its diagnostic
    """

    diagnostic: types.Diagnostic
    title: str
    file: str
    edit: types.TextEdit
    alone: bool


def quick_fixes(
    diagnostic: Diagnostic,
    edits: tuple[tuple[int, Edit], ...],
    shown_diagnostic: types.Diagnostic,
    texts: Texts,
    address: Callable[[str], str | None],
) -> Iterable[QuickFix]:
    """The quick fixes of a diagnostic that an editor shows."""
    helps = [n for n, _ in edits]
    for n, edit in edits:
        file = address(edit.file)
        if file is None:
            continue
        title = str(diagnostic.help[n])
        if helps.count(n) > 1:
            title = f"{title}: `{edit.text.strip()}`"
        first = texts.position(edit.file, edit.line, edit.column)
        last = texts.position(edit.file, edit.end_line, edit.end_column)
        yield QuickFix(
            shown_diagnostic, title, file, types.TextEdit(types.Range(first, last), edit.text), len(edits) == 1
        )


def actions(fixes: Iterable[QuickFix], selection: types.Range) -> list[types.CodeAction]:
    """The fixes whose diagnostics meet a range, in the form of an editor's list."""
    return [
        types.CodeAction(
            title=fix.title,
            kind=types.CodeActionKind.QuickFix,
            diagnostics=[fix.diagnostic],
            is_preferred=fix.alone or None,
            edit=types.WorkspaceEdit(changes={fix.file: [fix.edit]}),
        )
        for fix in fixes
        if _ordered(selection.start) <= _ordered(fix.diagnostic.range.end)
        and _ordered(fix.diagnostic.range.start) <= _ordered(selection.end)
    ]


def _ordered(position: types.Position) -> tuple[int, int]:
    return position.line, position.character
