"""An editor for tests: speaks to the real `met lsp` over pipes, and keeps what it is told."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from met.host import interpreter

WAIT = 120.0
"""Seconds until an answer counts as lacking."""


def uri(path: Path) -> str:
    return path.as_uri()


class Editor:
    """A client of a language server that it starts; `with Editor(folder) as editor:`."""

    def __init__(self, folder: Path, *arguments: str, options: Any = None, related: bool = True) -> None:
        self.folder = folder
        self._process = subprocess.Popen(
            [*interpreter.command("met.cli", "lsp"), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=interpreter.environment(),
            cwd=folder,
        )
        self._errors: list[bytes] = []
        self._came: queue.Queue[Any] = queue.Queue()
        self.diagnostics: dict[str, list[Any]] = {}
        self.versions: dict[str, int | None] = {}
        self.published: list[Any] = []
        self.logged: list[str] = []
        self.shown: list[str] = []
        self._number = 0
        self._versions: dict[str, int] = {}
        for target in (self._read, self._read_errors):
            threading.Thread(target=target, daemon=True).start()
        capabilities = {
            "textDocument": {"publishDiagnostics": {"relatedInformation": related, "versionSupport": True}},
            "workspace": {"didChangeWatchedFiles": {"dynamicRegistration": False}},
        }
        self.offered = self.ask(
            "initialize",
            {
                "processId": None,
                "rootUri": uri(folder),
                "capabilities": capabilities,
                "initializationOptions": options,
            },
        )["capabilities"]
        self.tell("initialized", {})

    def __enter__(self) -> Editor:
        return self

    def __exit__(self, *reason: object) -> None:
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            assert stream is not None
            try:
                stream.close()
            except (OSError, ValueError):
                pass

    @property
    def pid(self) -> int:
        return self._process.pid

    def end(self) -> int:
        """End the server as an editor does; its exit status."""
        self.ask("shutdown", None)
        self.tell("exit", None)
        return self._process.wait(WAIT)

    # what is sent

    def tell(self, method: str, parameters: Any) -> None:
        self._send({"method": method, "params": parameters})

    def ask(self, method: str, parameters: Any) -> Any:
        """The answer to a request; raises AssertionError where it is an error."""
        self._number += 1
        number = self._number
        self._send({"id": number, "method": method, "params": parameters})
        answer = self._wait(lambda message: message.get("id") == number and "method" not in message)
        assert "error" not in answer, answer["error"]
        return answer["result"]

    def about(self, method: str, path: Path, line: int = 0, character: int = 0, **more: Any) -> Any:
        """The answer to a request about a position in a file; both count from 0."""
        position = {"line": line, "character": character}
        return self.ask(method, {"textDocument": {"uri": uri(path)}, "position": position, **more})

    def open(self, path: Path, text: str | None = None) -> None:
        self._versions[uri(path)] = 1
        text = path.read_text() if text is None else text
        document = {"uri": uri(path), "languageId": "met", "version": 1, "text": text}
        self.tell("textDocument/didOpen", {"textDocument": document})

    def change(self, path: Path, text: str) -> int:
        """Change a whole text; its version."""
        self._versions[uri(path)] += 1
        document = {"uri": uri(path), "version": self._versions[uri(path)]}
        self.tell("textDocument/didChange", {"textDocument": document, "contentChanges": [{"text": text}]})
        return self._versions[uri(path)]

    def close(self, path: Path) -> None:
        self._versions.pop(uri(path), None)
        self.tell("textDocument/didClose", {"textDocument": {"uri": uri(path)}})

    def close_all(self) -> None:
        for address in list(self._versions):
            self.tell("textDocument/didClose", {"textDocument": {"uri": address}})
        self._versions.clear()
        self.settle()

    def forget(self) -> None:
        """Forget what came."""
        for kept in (self.published, self.logged, self.shown):
            kept.clear()

    # what comes

    def settle(self) -> None:
        """Wait until all that was sent is checked."""
        self.ask("met/settled", None)

    def next(self) -> None:
        """Wait for the next message."""
        self._wait(lambda message: True)

    def of(self, path: Path) -> list[Any]:
        """The diagnostics that the editor shows in a file, once all is checked."""
        self.settle()
        return self.diagnostics.get(uri(path), [])

    def errors(self) -> str:
        return b"".join(self._errors).decode(errors="replace")

    def _send(self, message: Any) -> None:
        data = json.dumps({"jsonrpc": "2.0", **message}).encode()
        assert self._process.stdin is not None
        self._process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(data) + data)
        self._process.stdin.flush()

    def _wait(self, wanted: Callable[[Any], bool]) -> Any:
        deadline = time.monotonic() + WAIT
        while True:
            try:
                message = self._came.get(timeout=max(deadline - time.monotonic(), 0.01))
            except queue.Empty:
                raise AssertionError(f"no answer; the server has said:\n{self.errors()[-2000:]}") from None
            assert message is not None, f"the server has gone:\n{self.errors()[-2000:]}"
            self._keep(message)
            if wanted(message):
                return message

    def _keep(self, message: Any) -> None:
        parameters = message.get("params")
        match message.get("method"):
            case "textDocument/publishDiagnostics":
                self.diagnostics[parameters["uri"]] = parameters["diagnostics"]
                self.versions[parameters["uri"]] = parameters.get("version")
                self.published.append(parameters)
            case "window/logMessage":
                self.logged.append(parameters["message"])
            case "window/showMessage":
                self.shown.append(parameters["message"])
            case str() if "id" in message:
                self._send({"id": message["id"], "result": None})

    def _read(self) -> None:
        stream = self._process.stdout
        assert stream is not None
        try:
            while head := stream.readline():
                length = int(head.split(b":")[1])
                while stream.readline().strip():
                    pass
                self._came.put(json.loads(stream.read(length)))
        except ValueError:
            pass
        self._came.put(None)

    def _read_errors(self) -> None:
        stream = self._process.stderr
        assert stream is not None
        try:
            for line in stream:
                self._errors.append(line)
        except ValueError:
            pass


def start(folder: Path, *arguments: str, **options: Any) -> Editor:
    """An editor in a folder, its server started."""
    assert sys.executable
    return Editor(folder, *arguments, **options)
