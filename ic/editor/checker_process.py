"""The server's end of the process that checks decks: requests go in, replies come back, one check at a time."""

from __future__ import annotations

import asyncio
import os
import pickle
import socket
import subprocess
from collections.abc import AsyncIterator

from ic.editor.checking import LENGTH, CheckRequest
from ic.editor.renaming import RenameRequest
from met.host import interpreter, system

LARGEST = 1 << 30  # bytes of one answer


class CheckerProcess:
    """Client of the process of `ic.editor.checker`, which it starts, again after it has ended."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None

    def start(self) -> None:
        """Start the process if it does not run; it warms up before the first request."""
        if self._process is not None and self._process.poll() is None:
            return
        self.close()
        folders = filter(None, os.environ.get("MET_DECK_PATH", "").split(os.pathsep))  # checks run in deck folders
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                interpreter.command("ic.editor.checker", str(theirs.fileno())),
                env={**interpreter.environment(), "MET_DECK_PATH": os.pathsep.join(map(os.path.abspath, folders))},
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=2,  # standard output is the editor's: nothing but the protocol may go there
            )
        self._socket = ours

    async def ask(self, request: CheckRequest | RenameRequest) -> AsyncIterator[object]:
        """The answers to a request as they come; none, or not all, where the check was stopped or has died."""
        self.start()
        assert self._socket is not None
        answers, out = os.pipe()
        with os.fdopen(system.nameless_file(), "w+b") as request_file, os.fdopen(out, "wb"):
            pickle.dump(request, request_file, pickle.HIGHEST_PROTOCOL)
            request_file.seek(0)
            try:
                socket.send_fds(self._socket, [b"c"], [request_file.fileno(), out])
            except OSError:
                os.close(answers)
                return
        reader = asyncio.StreamReader()
        transport, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(answers, "rb")
        )
        try:
            while True:
                (length,) = LENGTH.unpack(await reader.readexactly(LENGTH.size))
                if length > LARGEST:
                    return
                yield pickle.loads(await reader.readexactly(length))
        except asyncio.IncompleteReadError:
            return
        finally:
            transport.close()

    def stop_check(self) -> None:
        """Kill the check that runs."""
        if self._socket is not None:
            try:
                self._socket.sendall(b"s")
            except OSError:
                pass

    def close(self) -> None:
        """End the process, and the check that runs in it."""
        if self._socket is not None:
            self._socket.close()
        if self._process is not None:
            try:
                self._process.wait(2)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._socket = self._process = None
