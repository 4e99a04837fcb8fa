"""One check of a deck for an editor: what it is asked, and what it answers, between two processes."""

from __future__ import annotations

import os
import pickle
import struct
import traceback
from collections.abc import Mapping
from typing import TYPE_CHECKING

from met.diagnostic import Diagnostic
from met.frozen import frozen
from met.messages.edits import Edit

if TYPE_CHECKING:
    from ic.driver.compile import Compiled

LENGTH = struct.Struct("!Q")
"""The length of a pickled answer, which stands before it."""


@frozen
class CheckRequest:
    """A deck to be checked.

    folder   the folder that it stands in: the check runs there, and names of files are seen from there
    name     of its file; "" where it is in none
    text     of a deck that is in no file
    unsaved  texts of files that an editor has open, by real paths
    """

    folder: str
    name: str
    text: str | None
    include_dirs: tuple[str, ...]
    defines: tuple[str, ...]
    unsaved: Mapping[str, str]


@frozen
class CheckReply:
    """The findings of a check.

    diagnostics  as `met check` prints them
    edits        of each, with the number of its help
    sources      the text of every file that was read, by the name that places give it
    """

    diagnostics: tuple[Diagnostic, ...]
    edits: tuple[tuple[tuple[int, Edit], ...], ...]
    sources: Mapping[str, str]


@frozen
class Crash:
    """The traceback of a check that is a defect of MET."""

    traceback: str


def answer(request: CheckRequest, out: int) -> None:
    """Check, and write what there is to say into the file descriptor."""
    os.chdir(request.folder)
    try:
        compiled, reply = compiled_with_reply(request)
        _send(out, reply)
        if compiled.plan is not None:
            from ic.editor.index import index_of

            _send(out, index_of(compiled))
    except Exception:
        _send(out, Crash(traceback.format_exc()))


def compiled_with_reply(request: CheckRequest) -> tuple[Compiled, CheckReply]:
    """A deck compiled, and the reply to the request, made in this process."""
    from ic.driver.compile import check
    from met.messages.edits import edits

    compiled = check(
        request.name,
        include_dirs=request.include_dirs,
        defines=request.defines,
        select="all",
        text=request.text,
        unsaved=request.unsaved,
    )
    found = compiled.diagnostics
    beside = tuple(tuple(edits(each, compiled.sources)) for each in found)
    return compiled, CheckReply(found, beside, dict(compiled.sources))


def _send(out: int, answer: object) -> None:
    data = pickle.dumps(answer, pickle.HIGHEST_PROTOCOL)
    with os.fdopen(os.dup(out), "wb") as stream:
        stream.write(LENGTH.pack(len(data)) + data)
