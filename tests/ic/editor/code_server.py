"""Visual Studio Code for tests: code-server, which serves it to a browser, with MET's extension in it.

    with code_server(folder) as address, browser() as chromium:
        code = Code(chromium.open(address))
        code.open("arm.ic")

It has a folder of its own for settings and extensions, asks nothing of a network, and ends with the block.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from vsix import vsix

from met.host import interpreter
from tests.batch.report.browser import Page

PROGRAM = "code-server"
PATIENCE_SECONDS = 180.0
SETTINGS = {
    "workbench.startupEditor": "none",
    "telemetry.telemetryLevel": "off",
    "workbench.colorTheme": "Default Light Modern",
    "editor.minimap.enabled": False,
}

CONTROL, SHIFT = 2, 8
KEYS = {
    "Enter": (13, "Enter"), "Escape": (27, "Escape"), "End": (35, "End"), "F2": (113, "F2"), ".": (190, "Period"),
    " ": (32, "Space"),
}  # fmt: skip
"""The numbers and places of keys other than letters, by which the editor knows them."""

PLACE = """((text, nth) => {
    const walker = document.createTreeWalker(document.querySelector(".view-lines"), NodeFilter.SHOW_TEXT);
    for (let node, n = 0; (node = walker.nextNode());) {
        const at = node.textContent.replaceAll("\\u00a0", " ").indexOf(text);
        if (at < 0 || n++ < nth) continue;
        const range = document.createRange();
        range.setStart(node, at);
        range.setEnd(node, at + 1);
        const box = range.getBoundingClientRect();
        return [box.left + 2, box.top + box.height / 2];
    }
})"""
TEXTS = """(selector => Array.from(document.querySelectorAll(selector),
    each => [each.getBoundingClientRect().top, each.innerText.replaceAll("\\u00a0", " ")])
    .sort((one, other) => one[0] - other[0]).map(each => each[1]))"""


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
        return port


@contextmanager
def code_server(folder: Path) -> Iterator[str]:
    """The address of an editor that has a folder open."""
    program = shutil.which(PROGRAM)
    assert program is not None
    with TemporaryDirectory(prefix="met-code-", ignore_cleanup_errors=True) as given:
        home = Path(given)
        met, package = home / "met", home / "met.vsix"
        met.write_text(f'#!/bin/sh\nexec {sys.executable} -P -m met.cli "$@"\n')
        met.chmod(0o755)
        package.write_bytes(vsix())
        for name, settings in (("User", SETTINGS), ("Machine", {"met.command": str(met)})):
            (home / "user" / name).mkdir(parents=True)
            (home / "user" / name / "settings.json").write_text(json.dumps(settings))
        places = ["--user-data-dir", str(home / "user"), "--extensions-dir", str(home / "extensions")]
        environment = {**interpreter.environment(), "HOME": given, "XDG_CONFIG_HOME": given, "XDG_DATA_HOME": given}
        subprocess.run(
            [program, *places, "--install-extension", str(package)], env=environment, check=True, capture_output=True
        )
        address = f"127.0.0.1:{_free_port()}"
        words = ["--auth", "none", "--bind-addr", address, "--disable-telemetry", "--disable-update-check"]
        words += ["--disable-workspace-trust"]
        with subprocess.Popen(
            [program, *places, *words],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ) as process:
            try:
                _until_it_answers(f"http://{address}/healthz")
                yield f"http://{address}/?folder={folder}"
            finally:
                os.killpg(process.pid, 15)


def _until_it_answers(address: str) -> None:
    end = time.monotonic() + PATIENCE_SECONDS
    while True:
        try:
            urllib.request.urlopen(address, timeout=5).close()
            return
        except (urllib.error.URLError, OSError):
            assert time.monotonic() < end, f"no answer at {address}"
            time.sleep(0.2)


class Code:
    """The editor on a page."""

    def __init__(self, page: Page) -> None:
        self.page = page

    def until(self, expression: str) -> Any:
        """The value of a JavaScript expression, once it is one that counts as true."""
        end = time.monotonic() + PATIENCE_SECONDS
        while not (found := self.page.run(expression)):
            assert time.monotonic() < end, f"never: {expression}\n{self.text()}"
            time.sleep(0.2)
        return found

    def texts(self, selector: str) -> list[str]:
        """The texts of elements, from the top of the page to its end."""
        found: list[str] = self.page.run(f"{TEXTS}({json.dumps(selector)})")
        return found

    def until_text(self, selector: str, text: str) -> None:
        """Wait until one of the elements has a text in it."""
        self.until(f"{TEXTS}({json.dumps(selector)}).some(each => each.includes({json.dumps(text)}))")

    def text(self) -> str:
        """The lines of the text that are on the screen."""
        return "\n".join(self.texts(".view-line"))

    def until_in_text(self, text: str) -> None:
        self.until_text(".view-line", text)

    def open(self, name: str) -> None:
        """Open a file of the folder."""
        files = ".monaco-list-row .label-name"
        self.until_text(files, name)
        n = self.page.run(f"Array.from(document.querySelectorAll('{files}'), e => e.innerText).indexOf('{name}')")
        left, top, width, height = self.page.box(files, n)
        self.page.click(left + width / 2, top + height / 2, 2)
        self.until("document.querySelectorAll('.view-line').length > 1")

    def click(self, text: str, nth: int = 0) -> None:
        """Set the cursor on the beginning of a text."""
        x, y = self.until(f"{PLACE}({json.dumps(text)}, {nth})")
        self.page.click(x, y)
        time.sleep(0.3)

    def key(self, name: str, held: int = 0) -> None:
        number, where = KEYS.get(name) or (ord(name.upper()), f"Key{name.upper()}")
        types = name == "Enter" and not held
        for kind in ("keyDown" if types else "rawKeyDown", "keyUp"):
            self.page.ask(
                "Input.dispatchKeyEvent",
                type=kind,
                key=name,
                code=where,
                windowsVirtualKeyCode=number,
                modifiers=held,
                **({"text": "\r"} if types and kind == "keyDown" else {}),
            )

    def write(self, text: str) -> None:
        self.page.ask("Input.insertText", text=text)

    def colours(self, words: Sequence[str]) -> list[str]:
        """The colour of each word, where it first stands alone."""
        found: list[str] = self.page.run(
            "(words => { const spans = Array.from(document.querySelectorAll('.view-line span span'));"
            "return words.map(word => getComputedStyle(spans.find(span => span.innerText.trim() === word)).color); })"
            f"({json.dumps(words)})"
        )
        return found
