"""Quick fixes: the edits of diagnostics' helps, where the text is still the checked one."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from lsprotocol import types

from ic.editor.positions import Texts
from met.diagnostic import Diagnostic
from met.frozen import frozen
from met.messages.edits import Edit


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
