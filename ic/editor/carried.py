"""Messages of the last check, carried over into texts that have changed since, until these are checked: none flickers.

What stands in lines that have not changed is taken for still right, at the place where these lines are now. So while a
check tells what it has found so far, what it has not come to yet stays on the screen.
"""

from __future__ import annotations

from dataclasses import replace

from ic.editor.checking import CheckReply
from met.diagnostic import Diagnostic, Label, Place


class _MovedLines:
    """Where the lines of a text are in another one that differs in one stretch of lines."""

    def __init__(self, before: str, after: str) -> None:
        old, new = before.split("\n"), after.split("\n")
        most = min(len(old), len(new))
        self._first = next((n for n in range(most) if old[n] != new[n]), most)
        same = next((n for n in range(most - self._first) if old[-1 - n] != new[-1 - n]), most - self._first)
        self._behind, self._further = len(old) - same, len(new) - len(old)

    def line(self, line: int) -> int | None:
        """Where a line is now, counted from 1; None where it has changed."""
        if line <= self._first:
            return line
        return line + self._further if line > self._behind else None


class _Changed(Exception):
    """Raised where a place is in a line that has changed."""


def carried_over(last: CheckReply, now: CheckReply) -> CheckReply:
    """A reply to which more is to come, with what the last one said of lines that are as they were."""
    moved = {name: _MovedLines(last.sources[name], text) for name, text in now.sources.items() if name in last.sources}

    def line(file: str, at: int) -> int:
        found = moved[file].line(at) if file in moved else at
        if found is None:
            raise _Changed
        return found

    def place(old: Place) -> Place:
        return replace(
            old,
            line=line(old.file, old.line),
            expansions=tuple(replace(step, use=place(step.use)) for step in old.expansions),
            included=tuple((file, line(file, at)) for file, at in old.included),
        )

    def label(old: Label) -> Label:
        return replace(old, place=place(old.place))

    told = {(each.code, each.at.place) for each in now.diagnostics if each.at is not None}
    kept: list[Diagnostic] = []
    for each in last.diagnostics:
        try:
            at = label(each.at) if each.at is not None else None
            if at is not None and (each.code, at.place) not in told:
                kept.append(replace(each, at=at, also=tuple(map(label, each.also))))
        except _Changed:
            continue
    return replace(now, diagnostics=(*now.diagnostics, *kept), edits=(*now.edits, *(() for _ in kept)))
