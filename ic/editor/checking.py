"""One check of a deck for an editor, or one proof of a renaming: its request and its answers, between two processes.

First the definitions are checked, without the audit, which builds programs. Their findings are reported, in parts where
it takes long. The audit, `met check` itself, comes after a pause, so that a typing user never waits for it.
"""

from __future__ import annotations

import pickle
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from pathlib import Path

from ic.driver.by_definition import DefinitionChecks, Known
from ic.driver.compile import Compiled, check
from ic.editor.index import DeckIndex, index_of
from ic.read import read
from met.analysis.memo import AnalysisMemo
from met.diagnostic import Diagnostic, Problem
from met.frozen import frozen
from met.messages.edits import Edit, edits

LENGTH = struct.Struct("!Q")
"""The length of a pickled answer, which precedes it."""

EARLY = 0.05
"""Seconds from the start of a check after which its findings so far are reported; then again after as long as it has
taken, if that is more."""

DEAR = 0.5
"""Seconds of an audit after which its findings are kept, even if it does not end."""

AUDIT_PAUSE = 0.3
"""Seconds without a change after which the audit begins."""


@frozen
class CheckRequest:
    """A deck to be checked.

    folder   the folder that it stands in: the check runs there, and names of files are seen from there
    name     of its file; "" where it is in none
    text     of a deck that is in no file
    unsaved  texts of files that an editor has open, by real paths
    known    findings of the deck's definitions, of the last check of which all were told
    answers  of the analysis to the deck's experiments, of the last audit, pickled; none where it is empty
    """

    folder: str
    name: str
    text: str | None
    include_dirs: tuple[str, ...]
    defines: tuple[str, ...]
    unsaved: Mapping[str, str]
    known: Known = field(default_factory=dict)
    answers: bytes = b""


@frozen
class FoundAnswers:
    """Answers of analyses that an audit has computed, pickled: input of the next audit, even if this one does not
    end."""

    pickled: bytes


@frozen
class CheckReply:
    """The findings of a check.

    diagnostics  in the words and the order of `met check`
    edits        of each, with the number of its help
    sources      the text of every file that was read, by the name that places give it
    known        findings of all definitions, before the audit; None where some of them are to come, and with the audit
    audited      whether these are all that `met check` has to say
    """

    diagnostics: tuple[Diagnostic, ...]
    edits: tuple[tuple[tuple[int, Edit], ...], ...]
    sources: Mapping[str, str]
    known: Known | None = None
    audited: bool = True


@frozen
class Crash:
    """The traceback of a check that is a defect of MET."""

    traceback: str


def answers(
    request: CheckRequest, *, pause: float, keep: Callable[[FoundAnswers], object] = lambda _: None
) -> Iterator[CheckReply | DeckIndex]:
    """All answers about a deck, in turn; the audit comes after the pause, in s.

    keep called with the audit's answers so far, each time that one was slow, and at the end
    """
    readable = False
    for reply in first_replies(request):
        readable |= not reply.audited
        yield reply
    if not readable:
        return
    time.sleep(pause)
    compiled, reply = compiled_with_reply(request, keep)
    yield reply
    if compiled.plan is not None:
        yield index_of(compiled)


def first_replies(request: CheckRequest, clock: Callable[[], float] = time.monotonic) -> Iterator[CheckReply]:
    """Replies before the audit; for a deck that cannot be read, all of them. clock: in s"""
    began = clock()
    try:
        deck = read(
            Path(request.name),
            [Path(include_dir) for include_dir in request.include_dirs],
            request.defines,
            despite_errors=True,
            text=request.text,
            unsaved=request.unsaved,
        )
    except Problem as problem:
        yield _reply(problem.diagnostics, problem.sources)
        return
    checks, reported, last = DefinitionChecks(deck, request.known), None, began
    while checks.to_come:
        if clock() - last > EARLY and (diagnostics := checks.diagnostics()) != reported:
            yield _reply(*diagnostics, audited=False)
            reported, last = diagnostics, clock()
        checks.check_next()
    yield _reply(*checks.diagnostics(), known=checks.findings, audited=False)


def compiled_with_reply(
    request: CheckRequest, keep: Callable[[FoundAnswers], object] = lambda _: None
) -> tuple[Compiled, CheckReply]:
    """A compiled deck, with the reply to the request, made in this process. keep: as for `answers`"""
    kept_at = time.monotonic()

    def keep_so_far() -> None:
        """Hand over the answers of the analysis found so far, if that was not done for a while, in case the check is
        stopped."""
        nonlocal kept_at
        if time.monotonic() - kept_at > DEAR:
            keep(FoundAnswers(pickle.dumps(memo.so_far, pickle.HIGHEST_PROTOCOL)))
            kept_at = time.monotonic()

    memo = AnalysisMemo(pickle.loads(request.answers) if request.answers else None, keep_so_far)
    compiled = check(
        request.name,
        include_dirs=request.include_dirs,
        defines=request.defines,
        select="all",
        text=request.text,
        unsaved=request.unsaved,
        memo=memo,
    )
    keep(FoundAnswers(pickle.dumps(memo.answers, pickle.HIGHEST_PROTOCOL)))
    return compiled, _reply(compiled.diagnostics, compiled.sources)


def _reply(
    diagnostics: tuple[Diagnostic, ...], sources: Mapping[str, str], *, known: Known | None = None, audited: bool = True
) -> CheckReply:
    """The answer of a check to the server, with the edits that carry out each diagnostic's help."""
    return CheckReply(
        diagnostics,
        tuple(tuple(edits(diagnostic, sources)) for diagnostic in diagnostics),
        dict(sources),
        known,
        audited,
    )
