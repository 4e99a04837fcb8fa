"""The page of a deck that is watched, over HTTP, on this machine alone and to one who has its address.

Others use the machine too, and their browsers and programs reach every port of it; and any page in one's own browser
can send requests there. So requests are refused without the token in the address, with the name of another host (as
after DNS rebinding), or from another page. Nothing of the disk is served: there are only five names to ask for.

The run is a page of its own in it, with all scripts, and no run at first. Each run to show is passed to it as data,
replaces the one before, and keeps its viewpoint.
"""

from __future__ import annotations

import hmac
import io
import json
import secrets
import sys
import threading
import time
from contextlib import suppress
from functools import cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socket import socket
from socketserver import TCPServer
from typing import Any
from urllib.parse import parse_qs

from batch.portable.page import page_text
from batch.report.html import inlined
from batch.report.html.markup import Html, el, lines
from batch.watching.board import Board
from batch.watching.door import Door
from met.diagnostic import Problem, error

_ASSETS = Path(__file__).with_name("assets")


BY_CASE = ("points.js", "overview.js", "cells.js", "map.js")
"""Scripts of the report that draw a sweep's cases as points and maps."""


def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8").strip()


@cache
def frame() -> tuple[str, str]:
    """The whole text, the same for each deck, with its content security policy."""
    script, style = _asset("frame.js"), "\n".join([inlined.style(), _asset("frame.css")])
    policy = (
        f"default-src 'none'; script-src {inlined.digest(script)}; style-src {inlined.digest(style)}; img-src data:; "
        "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    head = lines(
        [
            el("meta", charset="utf-8"),
            el("meta", name="viewport", content="width=device-width, initial-scale=1"),
            el("meta", name="color-scheme", content="light dark"),
            el("link", rel="icon", href="data:,"),
            el("title", "met view"),
            Html(f"<style>{style}</style>"),
        ]
    )
    none = el("noscript", el("p", "This page needs scripts, which this reader does not run."))
    body = lines([none, Html(f"<script>{script}</script>")])
    text = f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'
    return text, policy


@cache
def page_of_runs() -> str:
    """The whole text of the page in the frame, the same for each run; `assets/kept.js` passes it one run after
    another."""
    empty = {"kicker": "", "name": "", "lede": ""}
    return page_text(empty, [_asset("kept.js")], before=BY_CASE, style=_asset("kept.css"))


FRAME_POLICY = "default-src 'none'; frame-ancestors 'none'"
"""The policy of answers that are not pages."""


HOST = "127.0.0.1"
TOKEN_BYTES = 24

MOST_OPEN = 64
"""Largest number of open connections that have shown the token: a browser has two for all its pages. Further ones are
refused for a while, so that memory stays bounded."""

FULL = b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 1\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
"""The answer to a client with the token when all connections are taken."""

LOOK_SECONDS = 0.25
"""Seconds after which those who wait outside are looked at again, and the end of the server is noticed."""

IDLE_SECONDS = 10.0
"""Seconds for a whole request, and for a whole answer, after which the connection is closed."""

ALIVE_SECONDS = 15.0
"""Seconds between two signs of life to a waiting page, by which a closed one is noticed."""

MOST_CHOICE = 10_000
"""Largest size of a choice in bytes."""

SAFE = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
INNER_POLICY = "frame-ancestors 'self'"
"""An additional policy besides the page's own."""


class PageServer(ThreadingHTTPServer):
    """Server of the board until it is closed. Raises Problem E477 where the port cannot be had."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = MOST_OPEN

    def __init__(self, board: Board, port: int = 0) -> None:
        self.board, self.token = board, secrets.token_urlsafe(TOKEN_BYTES)
        self._open = threading.Semaphore(MOST_OPEN)
        self._begun: dict[Any, bytes] = {}
        self._ended, self._serving = threading.Event(), threading.Thread(target=self._serve, daemon=True)
        try:
            super().__init__((HOST, port), _Request)
        except OSError as reason:
            helps = "leave `--port` out: a free one is taken"
            message = f"cannot serve on port {port} of {HOST}: {(reason.strerror or str(reason)).lower()}"
            raise Problem(error("E477", message, help=helps)) from reason
        self.hosts = tuple(f"{name}:{self.server_port}" for name in (HOST, "localhost"))

    @property
    def address(self) -> str:
        """The page's address, for a browser on this machine."""
        return f"http://{HOST}:{self.server_port}/{self.token}/"

    def begin(self) -> None:
        """Serve, in a thread of its own."""
        self._serving.start()

    def end(self) -> None:
        """Stop serving, and release everybody who waits."""
        self.board.end()
        self._ended.set()
        if self._serving.is_alive():
            self._serving.join()
        self.server_close()

    def _serve(self) -> None:
        """Let in who has the token, until the server ends."""
        door = Door(self.socket, self.token, self._admit)
        door.open()
        while not self._ended.is_set():
            door.attend(LOOK_SECONDS)
        door.close()

    def _admit(self, request: socket, client_address: Any, begun: bytes) -> None:
        """Answer one who has shown the token, in a thread of its own. begun: what was read of the request"""
        if self._open.acquire(blocking=False):
            self._begun[request] = begun
            try:
                self.process_request(request, client_address)
            except RuntimeError:  # no thread can be had
                self._open.release()
                self.begun(request)
                self.shutdown_request(request)
        else:
            with suppress(OSError):  # nothing waits here: a short answer goes at once or not at all
                request.send(FULL)
                request.recv(1 << 16)
            self.shutdown_request(request)

    def begun(self, request: socket) -> bytes:
        """Give back the bytes that were read of a request before its connection was let in; empty the second time."""
        return self._begun.pop(request, b"")

    def process_request_thread(self, request: socket | Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._open.release()

    def server_bind(self) -> None:
        """Bind like a plain TCP server: the HTTP server's method asks a network for this machine's name."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = HOST, int(self.server_address[1])

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a broken connection."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _InTime(io.RawIOBase):
    """The input of a connection, all of which must come within a time; afterwards reading raises TimeoutError. begun:
    its first bytes, which were read before"""

    def __init__(self, connection: socket, seconds: float, begun: bytes) -> None:
        self._connection, self._seconds, self._end = connection, seconds, time.monotonic() + seconds
        self._begun = begun

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        """Read from the connection into a buffer, and return the number of bytes. Raises TimeoutError where the request
        takes too long."""
        if self._begun:
            count = min(len(buffer), len(self._begun))
            buffer[:count], self._begun = self._begun[:count], self._begun[count:]
            return count
        left = self._end - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        self._connection.settimeout(left)
        try:
            return self._connection.recv_into(buffer)
        finally:
            self._connection.settimeout(self._seconds)


class _Request(BaseHTTPRequestHandler):
    """One request: GET of the frame, the page in it, a run's data, numbers of its cases, events; POST of a choice."""

    server: PageServer
    server_version, sys_version = "met", ""
    timeout = IDLE_SECONDS

    def setup(self) -> None:
        super().setup()
        self.rfile = io.BufferedReader(_InTime(self.connection, self.timeout, self.server.begun(self.request)))

    def do_GET(self) -> None:
        """Answer a request for the frame, its events, the page or its numbers."""
        what, number = self._requested()
        if what == "":
            text, policy = frame()
            self._send(text.encode(), "text/html; charset=utf-8", policy)
        elif what == "events":
            self._events()
        elif what in ("page", "numbers") and (stored := self.server.board.text(what, number)) is not None:
            self._send(stored, "application/json", FRAME_POLICY)
        elif what == "run":
            self._send(page_of_runs().encode(), "text/html; charset=utf-8", INNER_POLICY)
        elif what is not None:
            self._refuse(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """Take the choice of a run and a group that is made on the page."""
        what, _ = self._requested(posted=True)
        if what is None:
            return
        size = self.headers.get("Content-Length", "")
        if what != "choose" or not _is_number(size) or int(size) > MOST_CHOICE:
            self._refuse(HTTPStatus.NOT_FOUND if what != "choose" else HTTPStatus.BAD_REQUEST)
            return
        form = parse_qs(self.rfile.read(int(size)).decode("utf-8", "replace"))
        run, group = (form.get(name, [None])[0] for name in ("run", "group"))
        if run is not None and self.server.board.choose(run, group):
            self._send(b"", "text/plain", FRAME_POLICY)
        else:
            self._refuse(HTTPStatus.BAD_REQUEST)

    def _requested(self, posted: bool = False) -> tuple[str | None, int]:
        """The requested name after the token, and its number; None where the request was refused."""
        hosts = self.headers.get_all("Host") or []
        if len(hosts) != 1 or hosts[0] not in self.server.hosts:
            return self._refuse(HTTPStatus.MISDIRECTED_REQUEST)
        origin, site = self.headers.get("Origin"), self.headers.get("Sec-Fetch-Site", "none")
        foreign = origin != f"http://{hosts[0]}" and (posted or origin is not None)
        if foreign or site not in ("none", "same-origin"):
            return self._refuse(HTTPStatus.FORBIDDEN)
        first, _, rest = self.path.partition("?")[0].removeprefix("/").partition("/")
        known = hmac.compare_digest(first.encode("utf-8", "replace"), self.server.token.encode())
        what, _, number = rest.partition("/")
        if not known or not self.path.startswith(f"/{self.server.token}/"):
            return self._refuse(HTTPStatus.NOT_FOUND)
        if number and not _is_number(number):
            return self._refuse(HTTPStatus.NOT_FOUND)
        return what, int(number or 0)

    def _events(self) -> None:
        """Send the state each time that it changes, until the page is closed or the server ends."""
        self.send_response(HTTPStatus.OK)
        self._head("text/event-stream", FRAME_POLICY)
        self.end_headers()
        number = 0
        while not self.server.board.ended:
            number, state = self.server.board.after(number, ALIVE_SECONDS)
            event = ":\n\n" if state is None else f"data: {json.dumps(state)}\n\n"
            try:
                self.wfile.write(event.encode())
                self.wfile.flush()
            except OSError:
                return

    def _send(self, body: bytes, kind: str, policy: str) -> None:
        """Send an answer. kind: its content type; policy: its content security policy"""
        self.send_response(HTTPStatus.OK)
        self._head(kind, policy)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        with suppress(OSError):
            self.wfile.write(body)

    def _head(self, kind: str, policy: str) -> None:
        self.send_header("Content-Type", kind)
        self.send_header("Content-Security-Policy", policy)
        for name, value in SAFE.items():
            self.send_header(name, value)

    def _refuse(self, status: HTTPStatus) -> tuple[None, int]:
        """Answer with a status only, which reveals nothing."""
        self.send_response(status)
        self.send_header("Content-Length", "0")
        self.end_headers()
        return None, 0

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Answer unreadable requests in the same way."""
        self._refuse(HTTPStatus(code))

    def log_message(self, format: str, *words: Any) -> None:
        """Log nothing: an address holds the token."""


def _is_number(text: str) -> bool:
    """True for at most nine digits."""
    return text.isascii() and text.isdigit() and len(text) < 10
