"""Messages of the last check, carried over into texts that have changed since, until these are checked, to avoid
flicker.

Messages about unchanged lines are assumed to be still right, at the present places of these lines. So while a check
reports its first findings, messages of the parts that it has not reached stay on the screen: of the definitions, and of
the audit, which may take long.
"""

from __future__ import annotations

from dataclasses import replace

from ic.editor.checking import CheckReply
from met.diagnostic import Diagnostic, Label, Place


class _MovedLines:
    """The map of a text's lines to another text that differs in one stretch of lines."""

    def __init__(self, before: str, after: str) -> None:
        old, new = before.split("\n"), after.split("\n")
        most = min(len(old), len(new))
        self._first = next((n for n in range(most) if old[n] != new[n]), most)
        same = next((n for n in range(most - self._first) if old[-1 - n] != new[-1 - n]), most - self._first)
        self._behind, self._further = len(old) - same, len(new) - len(old)

    def line(self, line: int) -> int | None:
        """The present number of a line, counted from 1; None where it has changed."""
        if line <= self._first:
            return line
        return line + self._further if line > self._behind else None


class _Changed(Exception):
    """Raised where a place is in a line that has changed."""


def carried_over(last: CheckReply, now: CheckReply) -> CheckReply:
    """A preliminary reply, completed by the last one's messages about unchanged lines."""
    moved = {name: _MovedLines(last.sources[name], text) for name, text in now.sources.items() if name in last.sources}

    def line(file: str, number: int) -> int:
        line_now = moved[file].line(number) if file in moved else number
        if line_now is None:
            raise _Changed
        return line_now

    def place(old: Place) -> Place:
        return replace(
            old,
            line=line(old.file, old.line),
            expansions=tuple(replace(step, use=place(step.use)) for step in old.expansions),
            included=tuple((file, line(file, number)) for file, number in old.included),
        )

    def label(old: Label) -> Label:
        return replace(old, place=place(old.place))

    reported = {(new.code, new.at.place) for new in now.diagnostics if new.at is not None}
    diagnostics: list[Diagnostic] = []
    for diagnostic in last.diagnostics:
        try:
            moved_label = label(diagnostic.at) if diagnostic.at is not None else None
            if moved_label is not None and (diagnostic.code, moved_label.place) not in reported:
                diagnostics.append(replace(diagnostic, at=moved_label, also=tuple(map(label, diagnostic.also))))
        except _Changed:
            continue
    return replace(now, diagnostics=(*now.diagnostics, *diagnostics), edits=(*now.edits, *(() for _ in diagnostics)))


class LastAudit:
    """The messages of a deck's last audit beyond those of its definitions, kept until the next audit has ended."""

    def __init__(self) -> None:
        self._last: CheckReply | None = None
        self._defined: CheckReply | None = None  # the reply of the definitions whose audit has not ended

    def carried_into(self, reply: CheckReply) -> CheckReply:
        """The reply of all definitions, with the audit's messages about unchanged lines. Where definitions have errors
        nothing is added, since an audit then examines no program, but the messages are kept until the errors are
        corrected."""
        self._defined = reply
        if self._last is not None:
            self._last = carried_over(self._last, replace(reply, diagnostics=(), edits=()))
        return reply if self._last is None or _has_errors(reply) else carried_over(self._last, reply)

    def take(self, reply: CheckReply) -> None:
        """Keep the messages of an audit, the one that belongs to the last reported definitions."""
        if self._defined is not None and not _has_errors(self._defined):
            new = [n for n, diagnostic in enumerate(reply.diagnostics) if diagnostic not in self._defined.diagnostics]
            diagnostics = tuple(reply.diagnostics[n] for n in new)
            self._last = replace(reply, diagnostics=diagnostics, edits=tuple(reply.edits[n] for n in new))
        self._defined = None

    def give_up(self) -> CheckReply | None:
        """Discard the kept messages where an audit has died; returns the reply of the definitions alone. None where it
        has ended, or nothing is kept."""
        alone = self._defined if self._last is not None else None
        if alone is not None:
            self._last = None
        return alone


def _has_errors(reply: CheckReply) -> bool:
    return any(diagnostic.severity == "error" for diagnostic in reply.diagnostics)
