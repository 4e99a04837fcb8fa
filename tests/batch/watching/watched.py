"""`met view DECK` in a process of its own, and what its page would hear of it."""

from __future__ import annotations

import http.client
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

PATIENCE_SECONDS = 120.0

DECK = """\
#include <two_link.ic>
#include "length.ic"
run brief like nominal {
    duration = length;
    remove settle;
    require volts < 3.55 V;
}
default sweep tuned of brief {
    vary gearbox.kp = [0.005, 0.01, 0.02] V*s/rad;
    vary links.upper.mass = [45000, 90000] g;
}
"""
LENGTH = "let length = 2 s;\n"


def write_deck(folder: Path, text: str = DECK) -> Path:
    """A deck of two files."""
    (folder / "length.ic").write_text(LENGTH, encoding="utf-8")
    (folder / "deck.ic").write_text(text, encoding="utf-8")
    return folder / "deck.ic"


def replace(path: Path, old: str, new: str) -> None:
    """Save a file as many editors do: beside it, and then by a rename."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    beside = path.with_name(f".{path.name}.new")
    beside.write_text(text.replace(old, new), encoding="utf-8")
    beside.replace(path)


@dataclass
class Answer:
    status: int
    headers: http.client.HTTPMessage
    body: bytes


def ask(port: int, path: str, *, method: str = "GET", body: str | None = None, **headers: str | None) -> Answer:
    """A request as it stands here, without any header that is not: `Sec_Fetch_Site` is one with lines."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_SECONDS)
    try:
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        given = {"Host": f"127.0.0.1:{port}", **headers}
        if body is not None:
            given.setdefault("Content_Length", str(len(body)))
        for name, value in given.items():
            if value is not None:
                connection.putheader(name.replace("_", "-"), value)
        connection.endheaders(None if body is None else body.encode())
        answer = connection.getresponse()
        return Answer(answer.status, answer.headers, answer.read())
    finally:
        connection.close()


@dataclass
class View:
    """A view that runs."""

    process: subprocess.Popen[str]
    address: str
    state: dict[str, Any] = field(default_factory=dict)
    _events: Any = None

    @property
    def port(self) -> int:
        port = urlsplit(self.address).port
        assert port is not None
        return port

    @property
    def path(self) -> str:
        """Of the page, with its token."""
        return urlsplit(self.address).path

    def ask(self, what: str, **words: Any) -> Answer:
        return ask(self.port, self.path + what, **words)

    def hear(self) -> dict[str, Any]:
        """The next state."""
        if self._events is None:
            connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_SECONDS)
            connection.request("GET", self.path + "events")
            self._events = connection.getresponse()
        while not (line := self._events.readline()).startswith(b"data: "):
            assert line, "it has ended"
        self.state = json.loads(line[6:])
        return self.state

    def until(self, **wanted: Any) -> dict[str, Any]:
        """The first state, this one or one that follows, in which these entries are so."""
        end = time.monotonic() + PATIENCE_SECONDS
        while not self.state or any(self.state[name] != value for name, value in wanted.items()):
            assert time.monotonic() < end
            self.hear()
        return self.state

    def whole(self, page: int) -> dict[str, Any]:
        """The state in which all cases of this page have run."""
        while not (self.until(page=page, doing="")["numbers"]):
            self.hear()
        return self.state

    def numbers(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.ask(f"numbers/{self.state['numbers']}").body)
        return found


def started(*words: str | Path, **about: Any) -> subprocess.Popen[str]:
    """`met view` in a process of its own."""
    command = [sys.executable, "-m", "met.cli", "view", *map(str, words)]
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=about.pop("cwd", None),
        env={**os.environ, **about.pop("env", {})},
        **about,
    )


@contextmanager
def viewing(*words: str | Path, **about: Any) -> Iterator[View]:
    """A view until the end of the block."""
    with started(*words, **about) as process:
        try:
            assert process.stdout is not None
            yield View(process, process.stdout.readline().strip())
        finally:
            process.kill()
