"""The order of checks: of the decks that an editor has open, again after each change that concerns them.

An open text is a deck of its own unless another open deck includes it. A check waits until nothing was typed for a
moment; a change while it runs ends it, and while its audit runs that of another deck does too. So messages are never
older than former ones, and once nothing changes any more they are those of a fresh start.

Messages of the last check are carried over into texts that have changed since, until these are checked, to avoid
flicker. Messages about unchanged lines are assumed to be still right, at the present places of these lines. So while a
check reports its first findings, messages of the parts that it has not reached stay on the screen: of the definitions,
and of the audit, which may take long.
"""

from __future__ import annotations

import asyncio
import os
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from ic.driver.by_definition import Known
from ic.editor.checker_process import CheckerProcess
from ic.editor.checking import CheckReply, CheckRequest, Crash, FoundAnswers
from ic.editor.index import DeckIndex
from ic.editor.positions import file_named, path_of
from ic.editor.structure import KnownStructures, used_files
from met.diagnostic import Diagnostic, Label, Place
from met.frozen import frozen
from met.host.files import real_path

NO_DECKS = (".csv", ".urdf")
"""The endings of files that decks name and that are not decks."""

PAUSE = 0.01
"""Seconds without a change before a check begins."""


@frozen
class OpenText:
    """A text that an editor has open."""

    uri: str
    text: str
    version: int | None

    @property
    def path(self) -> str | None:
        return path_of(self.uri)

    @property
    def identity(self) -> str:
        """The file's real path, or the address of a text without a file."""
        return self.uri if self.path is None else real_path(self.path)


@frozen
class CheckedDeck:
    """A deck with what its last check found.

    deck    the text that was checked; folder: what names of files are seen from; name: the deck's own
    texts   all texts that were open then, by address
    files   the identities of all files that were read
    used    names, without folders, of those that it uses, and which are decks of their own
    """

    deck: OpenText
    folder: str
    name: str
    texts: dict[str, OpenText]
    files: frozenset[str]
    used: frozenset[str]
    reply: CheckReply

    def texts_beside(self) -> dict[str, str]:
        """The texts of all its files but its own."""
        return {name: text for name, text in self.reply.sources.items() if name != self.name}


class DeckChecks:
    """The open texts, the known facts about each, and the one running check.

    refresh  called where what an editor draws in a text may change though the text does not: colours, lenses
    """

    def __init__(
        self,
        process: CheckerProcess,
        tell: Callable[[Iterable[CheckedDeck]], None],
        log: Callable[[str], None],
        refresh: Callable[[], None],
        *,
        include_dirs: Iterable[str] = (),
        defines: Iterable[str] = (),
    ) -> None:
        """process: checks decks, beside the server; tell: shows what is known of checked decks; log: takes lines for
        the editor's log"""
        self._process, self._tell, self._log, self._refresh = process, tell, log, refresh
        self.include_dirs, self.defines = tuple(include_dirs), tuple(defines)
        self.texts: dict[str, OpenText] = {}
        self.checked: dict[str, CheckedDeck] = {}
        self._stale: dict[str, None] = {}  # addresses of decks to be checked, in the order of changes
        self._known: dict[str, Known] = {}  # findings of each deck's definitions, by what they follow from
        self._answers: dict[str, bytes] = {}  # of the analysis, of each deck's last audit
        self._audits: dict[str, LastAudit] = {}
        self.indexes: dict[str, DeckIndex] = {}  # of each deck, when it could last be compiled
        self.structures = KnownStructures(self.texts)
        self._failed: set[str] = set()  # decks whose last check has died; nothing is known of what they are now
        self._running: str | None = None
        self._outdated = False
        self._auditing = False  # the check that runs has told what definitions come to
        self._due = 0.0
        self._wake = asyncio.Event()
        self._resting = asyncio.Event()
        self._resting.set()

    def open(self, text: OpenText) -> None:
        """Handle the opening of a text, which may complete another one."""
        self.texts[text.uri] = text
        self.all_changed()

    def change(self, text: OpenText) -> None:
        """Handle a change of a text, which affects the decks that read it."""
        self.texts[text.uri] = text
        self._changed([text.identity])

    def shut(self, uri: str) -> None:
        """Handle the closing of a text: its file counts again."""
        by_address: tuple[dict[str, Any], ...] = (
            self.texts,
            self.checked,
            self.indexes,
            self._known,
            self._answers,
            self._audits,
            self._stale,
        )
        for kept in by_address:
            kept.pop(uri, None)
        self._failed.discard(uri)
        self.structures.forget(uri)
        self.all_changed()
        self._tell(self.decks())

    def all_changed(self) -> None:
        """Check all decks anew, since files that no editor has open may have changed."""
        for uri in self.texts:
            self._make_stale(uri)

    def unsaved(self) -> dict[str, str]:
        """The open texts of files, by the files' real paths."""
        return {text.identity: text.text for text in self.texts.values() if text.path is not None}

    def deck_of(self, uri: str) -> CheckedDeck | None:
        """The deck that a text is part of, as last checked."""
        text = self.texts.get(uri)
        if uri in self.checked:
            return self.checked[uri]
        return next((deck for deck in self.decks() if text is not None and text.identity in deck.files), None)

    def decks(self) -> list[CheckedDeck]:
        """The known decks among the open texts that no other one includes."""
        return [self.checked[uri] for uri in self._roots() if uri in self.checked]

    def request(self, deck: OpenText) -> CheckRequest:
        """The request for a check of a deck, with all texts as they are now."""
        folder, name = os.path.split(deck.path) if deck.path is not None else (os.getcwd(), "")
        exists = os.path.isdir(folder) and os.access(folder, os.X_OK)
        return CheckRequest(
            folder if exists else os.getcwd(),
            name if exists else deck.path or "",
            deck.text if deck.path is None else None,
            self.include_dirs,
            self.defines,
            self.unsaved(),
            self._known.get(deck.uri, {}),
            self._answers.get(deck.uri, b""),
        )

    async def rest(self) -> None:
        """Wait until all messages are about the present texts."""
        await self._resting.wait()

    async def work(self) -> None:
        """Check changed decks, for ever: no document ends this."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            try:
                await self._check_all()
            except Exception:  # a defect in the choice of what to check: until the next change nothing is checked
                self._report_defect()
            self._resting.set()

    async def _check_all(self) -> None:
        """Check changed decks, each once its text has rested for a moment, until no change is left unchecked."""
        while (uri := self._next()) is not None:
            pause = self._due - time.monotonic()
            if pause > 0:
                await asyncio.sleep(pause)
                continue
            try:
                await self._check(uri)
            except Exception:  # a defect must not end the checks of other decks
                self._stale.pop(uri, None)
                self._failed.add(uri)
                self._report_defect()

    def _report_defect(self) -> None:
        self._log(f"this is a defect of MET; please report it:\n{traceback.format_exc()}")

    def _changed(self, identities: Iterable[str]) -> None:
        """Mark the decks to be checked again that are, or read, one of these files."""
        changed = set(identities)
        for uri, text in self.texts.items():
            checked = self.checked.get(uri)
            if text.identity in changed or (checked is not None and changed & checked.files):
                self._make_stale(uri)

    def _make_stale(self, uri: str) -> None:
        """Mark a deck as to be checked again, after a pause; a check of it that runs is stopped."""
        self._stale.pop(uri, None)
        self._stale[uri] = None
        self._due = time.monotonic() + PAUSE
        if self._running is not None and not self._outdated and (self._running == uri or self._auditing):
            if self._running != uri:  # its audit can wait
                self._stale = {self._running: None, **self._stale}
            self._outdated = True
            self._process.stop_check()
        self._wake.set()
        self._resting.clear()

    def _roots(self) -> list[str]:
        """The open texts that no other one includes; among some that include each other, the first that was opened."""
        roots = []
        order = list(self.texts)
        for n, uri in enumerate(order):
            if uri.endswith(NO_DECKS):
                continue
            identity = self.texts[uri].identity
            for m, other in enumerate(order):
                known = self.checked.get(other) if other != uri else None
                includes = known is not None and identity in known.files
                includes = includes and known is not None and os.path.basename(identity) not in known.used
                back = uri in self.checked and self.texts[other].identity in self.checked[uri].files
                if includes and (m < n or not back):
                    break
            else:
                roots.append(uri)
        return roots

    def _next(self) -> str | None:
        """The deck to check next, the last changed one first."""
        roots = self._roots()
        for uri in roots:
            if uri not in self.checked and uri not in self._failed:
                self._stale.setdefault(uri)
        waiting = [uri for uri in self._stale if uri in roots]
        return waiting[-1] if waiting else None

    async def _check(self, uri: str) -> None:
        """Run one check of an open deck in the checker's process, and take its answers one by one; a change of the
        deck's texts ends it. A deck whose check ends without an answer is noted as failed."""
        deck = self.texts[uri]
        texts, request = dict(self.texts), self.request(deck)
        self._running, self._outdated, self._auditing = uri, False, False
        self._stale.pop(uri, None)
        self._failed.discard(uri)
        answers = 0
        try:
            async for answer in self._process.ask(request):
                answers += 1
                if self._outdated or uri not in self.texts:
                    break
                self._take(deck, request, texts, answer)
        finally:
            self._running = None
        if self._outdated or uri not in self.texts:
            return
        if not answers:
            self._failed.add(uri)
            self._log(f"the check of {deck.path or uri} ended without an answer")
        if self._auditing and (alone := self._audits[uri].give_up()) is not None:
            self._keep(deck, request, texts, alone)

    def _take(self, deck: OpenText, request: CheckRequest, texts: dict[str, OpenText], answer: object) -> None:
        """Take one answer of a deck's check: a crash, answers to keep, an index, or messages to show."""
        if isinstance(answer, Crash):
            self._log(
                f"this is a defect of MET, not of what you gave it; please report it together with the deck, "
                f"{deck.path or deck.uri}:\n{answer.traceback}"
            )
            self._failed.add(deck.uri)
        if isinstance(answer, FoundAnswers):
            self._answers[deck.uri] = answer.pickled
        if isinstance(answer, DeckIndex):
            before, self.indexes[deck.uri] = self.indexes.get(deck.uri), answer
            if before is None or before.cases != answer.cases:
                self._refresh()
        if not isinstance(answer, CheckReply):
            return
        if answer.known is not None:
            self._known[deck.uri], self._auditing = answer.known, True
            answer = self._audits.setdefault(deck.uri, LastAudit()).carried_into(replace(answer, known=None))
        elif self._auditing:
            self._audits[deck.uri].take(answer)
        elif not answer.audited and deck.uri in self.checked:
            last_reply = self.checked[deck.uri].reply
            further = {name: text for name, text in last_reply.sources.items() if name not in answer.sources}
            answer = carried_over(last_reply, answer)
            answer = replace(answer, sources={**answer.sources, **further})  # files of values are read later
        self._keep(deck, request, texts, answer)

    def _keep(self, deck: OpenText, request: CheckRequest, texts: dict[str, OpenText], answer: CheckReply) -> None:
        """Keep a reply as the known state of the deck, and report it."""
        paths = (file_named(name, request.folder) for name in answer.sources)
        files = frozenset(real_path(path) for path in paths if path is not None)
        used = frozenset(name for text in answer.sources.values() for name in used_files(text))
        name = request.name if request.text is None else next(iter(answer.sources), "")
        checked = CheckedDeck(deck, request.folder, name, texts, files, used, answer)
        last, self.checked[deck.uri] = self.checked.get(deck.uri), checked
        self._tell(self.decks())
        if last is None or last.texts_beside() != checked.texts_beside():
            self._refresh()


class _MovedLines:
    """The map of a text's lines to another text that differs in one stretch of lines."""

    def __init__(self, before: str, after: str) -> None:
        old, new = before.split("\n"), after.split("\n")
        most = min(len(old), len(new))
        self._first = next((n for n in range(most) if old[n] != new[n]), most)
        same = next((n for n in range(most - self._first) if old[-1 - n] != new[-1 - n]), most - self._first)
        self._behind, self._further = len(old) - same, len(new) - len(old)

    def line(self, line: int) -> int:
        """The present number of a line, counted from 1. Raises LineChanged."""
        if self._first < line <= self._behind:
            raise LineChanged
        return line if line <= self._first else line + self._further


class LineChanged(Exception):
    """Raised where a place is in a line that has changed."""


def carried_over(last: CheckReply, now: CheckReply) -> CheckReply:
    """A preliminary reply, completed by the last one's messages about unchanged lines."""
    moved = {name: _MovedLines(last.sources[name], text) for name, text in now.sources.items() if name in last.sources}

    def line(file: str, number: int) -> int:
        """The present number of a line of a file. Raises _Changed where the line was changed."""
        return moved[file].line(number) if file in moved else number

    def place(old: Place) -> Place:
        """A place in the texts as they are now, with the places that it came through. Raises _Changed where a line was
        changed."""
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
        except LineChanged:
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
