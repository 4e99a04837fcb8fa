"""The process that checks decks for an editor, and proves renamings: warmed up once, it forks a child for each.

    python -m ic.editor.checker FD        started by `CheckerProcess`; FD is one end of a socket pair

Each check begins from the same state, so its result is that of a fresh start, and memory does not grow. Knowledge from
the last check is part of the request. An outdated check is killed. A crash affects only its own check.

On the socket, from the server, a byte each: `b"c"`, with two file descriptors, of a memory file that holds a pickled
`CheckRequest`, or a `RenameRequest`, and of the pipe for the answers; or `b"s"`, which stops the check that runs, as
the next one does too. The answers are pickled, each behind its length: `CheckReply`s, the last one with the audit, then
a `DeckIndex` where the deck could be compiled; the `Renamed` of a renaming; or a `Crash`.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import socket
import sys
import traceback
from functools import partial

from ic.editor.checking import AUDIT_PAUSE, LENGTH, CheckRequest, Crash, answers
from ic.editor.renaming import RenameRequest, renamed


def _warm_up() -> None:
    """Import the modules of a check, by running one; all children share them."""
    list(answers(CheckRequest(os.getcwd(), "", "#include <two_link.ic>\n", (), (), {}), pause=0.0))
    gc.collect()
    gc.freeze()


def serve(connection: socket.socket) -> None:
    """Answer the editor's requests, each in a forked process of its own that the next request ends, until the server
    has gone."""
    child = 0
    while True:
        head, passed, _, _ = socket.recv_fds(connection, 1, 2)
        if child:
            os.kill(child, signal.SIGKILL)  # it may have ended long ago; its number is not reused until `waitpid`
            os.waitpid(child, 0)
            child = 0
        if not head:
            return
        if head == b"s":
            continue
        child = os.fork()
        if child == 0:
            connection.close()
            status = 1
            try:
                with os.fdopen(passed[0], "rb") as request_file:
                    answer(pickle.load(request_file), passed[1])
                status = 0
            finally:
                os._exit(status)
        for descriptor in passed:
            os.close(descriptor)


def answer(request: CheckRequest | RenameRequest, out: int) -> None:
    """Run a check, or prove a renaming, and write the answers into the file descriptor."""
    if isinstance(request, CheckRequest):
        os.chdir(request.folder)
    try:
        if not isinstance(request, CheckRequest):
            return _send(out, renamed(request))
        for reply in answers(request, pause=AUDIT_PAUSE, keep=partial(_send, out)):
            _send(out, reply)
    except Exception:
        _send(out, Crash(traceback.format_exc()))


def _send(out: int, answer: object) -> None:
    data = pickle.dumps(answer, pickle.HIGHEST_PROTOCOL)
    with os.fdopen(os.dup(out), "wb") as stream:
        stream.write(LENGTH.pack(len(data)) + data)


def main() -> None:
    """Warm up, then serve the socket whose file descriptor is the argument."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which then closes the socket
    gc.set_threshold(50_000)
    with socket.socket(fileno=int(sys.argv[1])) as connection:
        _warm_up()
        try:
            serve(connection)
        except ConnectionError:
            pass


if __name__ == "__main__":
    main()
