"""A browser for tests: Chromium without a window, told what to do over a pipe, in the words of its DevTools protocol.

    with browser() as chromium:
        page = chromium.open(path, width=1280, height=900)
        page.run("document.title")

It has a folder of its own for all that it keeps, and ends with the block. Every request, message of the console and
error of the page is kept, so that a test can say that there was none.
"""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "chrome")
PACKAGE = "chromium"
PATIENCE_SECONDS = 60.0

# 3 and 4 are where Chromium reads and writes; without a sandbox, for it has none as root and in containers.
WORDS = (
    "--headless",
    "--no-sandbox",
    "--remote-debugging-pipe",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-extensions",
    "--disable-sync",
    "--no-first-run",
    "--no-default-browser-check",
    "--hide-scrollbars",
    "--mute-audio",
    "--font-render-hinting=none",
    "--force-color-profile=srgb",
)


INK = """(selector => Array.from(document.querySelectorAll(selector), canvas => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let inked = 0;
    for (let i = 3; i < data.length; i += 4) inked += data[i] > 0;
    return inked / (data.length / 4);
}))"""
"""Of each canvas the share of pixels that are drawn."""


GATHERED = """new Promise(done => {
    document.querySelector('.arm').scrollIntoView();
    const stage = () => MET.models[0].stage();
    const look = () => document.querySelector('[data-haunted]') && stage().isStill() ? done() : setTimeout(look, 20);
    look();
})"""
"""Until a report's arm is drawn with all its ghosts, and stands."""


class BrowserFailed(RuntimeError):
    """The browser did not do what it was told."""


def program() -> str | None:
    """Where a browser is."""
    return next((found for name in PROGRAMS if (found := shutil.which(name)) is not None), None)


@contextmanager
def browser(*, webgl: bool = True) -> Iterator[Chromium]:
    """A browser with nothing in it. webgl: whether it has WebGL, which is drawn by software."""
    found = program()
    if found is None:
        raise BrowserFailed(f"no {PROGRAMS[0]} here; on Debian: apt-get install {PACKAGE}")
    with TemporaryDirectory(prefix="met-browser-", ignore_cleanup_errors=True) as home:
        down, up = os.pipe(), os.pipe()
        command = [found, *WORDS, *(() if webgl else ("--disable-3d-apis",)), f"--user-data-dir={home}", "about:blank"]
        shell = ["/bin/bash", "-c", f'exec "$@" 3<&{down[0]} 4>&{up[1]}', "chromium", *command]
        with subprocess.Popen(
            shell,
            pass_fds=(down[0], up[1]),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "HOME": home},
            start_new_session=True,
        ) as process:
            os.close(down[0])
            os.close(up[1])
            chromium = Chromium(down[1], up[0])
            try:
                yield chromium
            finally:
                with suppress(BrowserFailed, OSError):
                    chromium.ask("Browser.close")
                try:
                    process.wait(10)
                except subprocess.TimeoutExpired:
                    process.kill()
                os.close(down[1])
                os.close(up[0])


def browser_or_skip() -> Iterator[Chromium]:
    """A browser, for fixtures; where there is none, the test is left out."""
    if program() is None:
        pytest.skip(f"no chromium; on Debian or Ubuntu: apt-get install {PACKAGE}")
    with browser() as started:
        yield started


@dataclass
class Chromium:
    """A browser that runs, and the two ends of its pipe."""

    down: int
    up: int
    asked: int = 0
    rest: bytes = b""
    pages: dict[str, Page] = field(default_factory=dict)

    def ask(self, method: str, session: str = "", **words: Any) -> dict[str, Any]:
        """Its answer; an error that it answers with raises BrowserFailed."""
        self.asked += 1
        told: dict[str, Any] = {"id": self.asked, "method": method, "params": words}
        if session:
            told["sessionId"] = session
        data = json.dumps(told).encode() + b"\0"
        while data:
            data = data[os.write(self.down, data) :]
        number = self.asked
        end = time.monotonic() + PATIENCE_SECONDS
        while True:
            said = self.hear(end)
            if said.get("id") == number:
                if "error" in said:
                    raise BrowserFailed(f"{method}: {said['error'].get('message')}")
                result: dict[str, Any] = said["result"]
                return result

    def hear(self, end: float) -> dict[str, Any]:
        """The next message; events of pages are kept by these."""
        while b"\0" not in self.rest:
            if not select.select([self.up], [], [], max(0.0, end - time.monotonic()))[0]:
                raise BrowserFailed("no answer")
            more = os.read(self.up, 1 << 20)
            if not more:
                raise BrowserFailed("it has ended")
            self.rest += more
        message, _, self.rest = self.rest.partition(b"\0")
        said: dict[str, Any] = json.loads(message)
        page = self.pages.get(said.get("sessionId", ""))
        if page is not None and "method" in said:
            page.told(said["method"], said.get("params", {}))
        return said

    def cpu_seconds(self) -> dict[str, float]:
        """The processor's time that its processes have taken, by kind: `browser`, `renderer`, `GPU`."""
        out: dict[str, float] = {}
        for each in self.ask("SystemInfo.getProcessInfo")["processInfo"]:
            out[each["type"]] = out.get(each["type"], 0.0) + each["cpuTime"]
        return out

    def open(
        self,
        path: Path | str,
        *,
        width: int = 1280,
        height: int = 900,
        dark: bool = False,
        scale: float = 1.0,
        scripts: bool = True,
    ) -> Page:
        """A page of this size (CSS pixels), when all of it is there: of a file, or at an address."""
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, session, target)
        self.pages[session] = page
        for domain in ("Page", "Runtime", "Network", "Log"):
            page.ask(f"{domain}.enable")
        page.ask(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=scale,
            mobile=width < 600,
        )
        page.ask(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}],
        )
        if not scripts:
            page.ask("Emulation.setScriptExecutionDisabled", value=True)
        page.ask("Page.navigate", url=path if isinstance(path, str) else path.resolve().as_uri())
        page.until_loaded()
        return page


@dataclass
class Page:
    """A page that is open. requests: addresses it asked for; said: messages of its console, errors among them."""

    browser: Chromium
    session: str
    target: str
    requests: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    loaded: bool = False

    def ask(self, method: str, **words: Any) -> dict[str, Any]:
        return self.browser.ask(method, self.session, **words)

    def told(self, event: str, about: dict[str, Any]) -> None:
        """An event of the page."""
        if event == "Network.requestWillBeSent":
            self.requests.append(about["request"]["url"])
        elif event == "Runtime.exceptionThrown":
            details = about["exceptionDetails"]
            self.said.append(details.get("exception", {}).get("description") or details["text"])
        elif event == "Runtime.consoleAPICalled":
            self.said.append(" ".join(str(each.get("value", each.get("description"))) for each in about["args"]))
        elif event == "Log.entryAdded":
            self.said.append(about["entry"]["text"])
        elif event == "Page.loadEventFired":
            self.loaded = True

    def until_loaded(self) -> None:
        end = time.monotonic() + PATIENCE_SECONDS
        while not self.loaded:
            self.browser.hear(end)

    def run(self, expression: str) -> Any:
        """The value of a JavaScript expression, which may be a promise. An error in it raises BrowserFailed."""
        answer = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise BrowserFailed(details.get("exception", {}).get("description") or details["text"])
        return answer["result"].get("value")

    def settle(self) -> None:
        """Until what was begun is drawn."""
        self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 60))))")

    def picture(self, path: Path, selector: str = "", margin: int = 16) -> Path:
        """A screenshot of all of the page, or of an element."""
        words: dict[str, Any] = {}
        if selector:
            box = self.run(
                f"(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
                "return [b.left + scrollX, b.top + scrollY, b.width, b.height]; })()"
            )
            words["clip"] = {
                "x": max(0, box[0] - margin),
                "y": max(0, box[1] - margin),
                "width": box[2] + 2 * margin,
                "height": box[3] + 2 * margin,
                "scale": 1,
            }
        answer = self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=True, **words)
        path.write_bytes(base64.b64decode(answer["data"]))
        return path

    def pdf(self, path: Path) -> Path:
        """Printed, on A4."""
        margins = {"marginTop": 0.59, "marginBottom": 0.59, "marginLeft": 0.55, "marginRight": 0.55}
        answer = self.ask("Page.printToPDF", paperWidth=8.27, paperHeight=11.69, printBackground=False, **margins)
        path.write_bytes(base64.b64decode(answer["data"]))
        return path

    def mouse(self, kind: str, x: float, y: float, *, clicks: int = 0, button: str = "left") -> None:
        """kind: `mouseMoved`, `mousePressed`, `mouseReleased`; x, y from the window's corner."""
        held = kind == "mouseMoved" and clicks
        down = 1 if kind == "mousePressed" or held else 0
        used = button if kind != "mouseMoved" or held else "none"
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, clickCount=clicks, button=used, buttons=down)

    def click(self, x: float, y: float, clicks: int = 1) -> None:
        self.mouse("mouseMoved", x, y)
        for number in range(1, clicks + 1):
            self.mouse("mousePressed", x, y, clicks=number)
            self.mouse("mouseReleased", x, y, clicks=number)

    def drag(self, points: Sequence[tuple[float, float]]) -> None:
        """Pressed at the first point, let go at the last."""
        self.mouse("mouseMoved", *points[0])
        self.mouse("mousePressed", *points[0], clicks=1)
        for x, y in points[1:]:
            self.mouse("mouseMoved", x, y, clicks=1)
        self.mouse("mouseReleased", *points[-1], clicks=1)

    def key(self, name: str, text: str = "") -> None:
        for kind in ("keyDown", "keyUp"):
            typed = {"text": text} if text and kind == "keyDown" else {}
            self.ask("Input.dispatchKeyEvent", type=kind, key=name, **typed)

    def box(self, selector: str, nth: int = 0) -> tuple[float, float, float, float]:
        """Left, top, width and height of an element that is brought into view."""
        left, top, width, height = self.run(
            f"(() => {{ const e = document.querySelectorAll({json.dumps(selector)})[{nth}];"
            "e.scrollIntoView({block: 'center'}); const b = e.getBoundingClientRect();"
            "return [b.left, b.top, b.width, b.height]; })()"
        )
        return left, top, width, height

    def close(self) -> None:
        self.browser.ask("Target.closeTarget", targetId=self.target)


def quiet(page: Page) -> None:
    """Nothing went wrong in it, and it asked for nothing but itself."""
    assert page.said == []
    assert [address.partition(":")[0] for address in page.requests if not address.startswith("data:")] == ["file"]
