"""The door of the page's server: who connects waits outside until the request's first line shows the token.

One thread keeps all who wait, so a stranger takes neither a thread nor a place of one who has the token. They are
bounded: of too many, the one that came first is turned away, and nobody waits for long.
"""

from __future__ import annotations

import hmac
import selectors
import time
from collections.abc import Callable
from contextlib import suppress
from socket import SHUT_RDWR, socket
from typing import Any

MOST_OUTSIDE = 128
"""Largest number of connections that wait for their first line; one who has the token sends it at once."""

OUTSIDE_SECONDS = 2.0
"""Seconds after which a connection that has not shown the token is closed."""

LONGEST_METHOD = 8
"""Letters of an HTTP method."""

STRANGE = b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
"""The answer to a stranger, the same whatever was asked."""


class Door:
    """The connections that have yet to show the token.

    admit  called with a connection that has shown it, its address, and the bytes that were read
    """

    def __init__(self, listening: socket, token: str, admit: Callable[[socket, Any, bytes], None]) -> None:
        self._listening, self._admit = listening, admit
        self._path_start = f"/{token}/".encode()
        self._outside: dict[socket, tuple[Any, float, bytearray]] = {}  # address, time of coming, what came
        self._waiting = selectors.DefaultSelector()

    def attend(self, seconds: float) -> None:
        """Wait at most this long for somebody, and handle all who came or said something."""
        for key, _ in self._waiting.select(seconds):
            if key.fileobj is self._listening:
                self._let_come()
            elif key.fileobj in self._outside:  # else it was turned away for one who came in this round
                self._listen_to(key.fileobj)
        late = time.monotonic() - OUTSIDE_SECONDS
        for address in [address for address, (_, since, _) in self._outside.items() if since < late]:
            self._turn_away(address)

    def open(self) -> None:
        self._listening.setblocking(False)
        self._waiting.register(self._listening, selectors.EVENT_READ)

    def close(self) -> None:
        """Turn all away."""
        for address in [*self._outside]:
            self._turn_away(address)
        self._waiting.close()

    def _let_come(self) -> None:
        """Accept a connection, which waits until its first line shows the token; the one that waits longest is turned
        away where too many wait."""
        try:
            connection, address = self._listening.accept()
        except OSError:  # it has gone again, or there are no more files: those outside make room soon
            if self._outside:
                self._turn_away(next(iter(self._outside)))
            return
        if len(self._outside) >= MOST_OUTSIDE:
            self._turn_away(next(iter(self._outside)))
        connection.setblocking(False)
        self._outside[connection] = address, time.monotonic(), bytearray()
        self._waiting.register(connection, selectors.EVENT_READ)
        self._listen_to(connection)

    def _listen_to(self, connection: socket) -> None:
        """Take what somebody sends: admit who asks for the page's path, and turn away who does not."""
        address, _, request = self._outside[connection]
        try:
            more = connection.recv(LONGEST_METHOD + 1 + len(self._path_start) - len(request))
        except BlockingIOError:
            return
        except OSError:
            more = b""
        request += more
        method, blank, path = request.partition(b" ")
        if not more or len(method) > LONGEST_METHOD or b"\n" in request:
            self._turn_away(connection, STRANGE if more else b"")
        elif blank and len(path) >= len(self._path_start):
            if hmac.compare_digest(path[: len(self._path_start)], self._path_start):
                self._forget(connection)
                self._admit(connection, address, bytes(request))
            else:
                self._turn_away(connection, STRANGE)

    def _forget(self, connection: socket) -> None:
        del self._outside[connection]
        self._waiting.unregister(connection)

    def _turn_away(self, connection: socket, answer: bytes = b"") -> None:
        """Close a connection, with a short answer if there is one: it goes at once or not at all."""
        self._forget(connection)
        with suppress(OSError):
            if answer:
                connection.send(answer)
                connection.recv(1 << 16)  # else the answer is lost with what is not read
            connection.shutdown(SHUT_RDWR)
        connection.close()
