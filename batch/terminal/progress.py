"""Display of a campaign's progress: a bar on a terminal, a plain line now and then elsewhere, nothing for short
work."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TextIO

from batch.campaigns.status import duration
from met.messages.visible import line

FIRST_SECONDS = 0.3
"""Time, s, before the bar is first drawn: shorter work needs none."""

BAR_SECONDS = 0.1
LINE_SECONDS, SELDOM = 5.0, 60.0
"""Seconds between two plain lines, at first and after a while: the log of a night's run should be readable."""

WIDTH = 24


@dataclass
class Bar:
    """Progress display: on a terminal it is drawn ten times a second; elsewhere a line is printed, at first every five
    seconds, after some minutes one a minute."""

    stream: TextIO = field(default_factory=lambda: sys.stderr)
    clock: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        self._live = self.stream.isatty()
        self._name, self._cases, self._first, self._workers = "", 0, 0, ""
        self._began, self._next, self._drawn = 0.0, 0.0, False

    def begin(self, name: str, cases: int, done: int = 0, failed: int = 0, workers: str = "") -> None:
        """Begin a new experiment, some of whose cases may be done already. cases: 0 where their number is not known"""
        self._name, self._cases, self._first, self._workers = line(name), cases, done, line(workers)
        self._began = self.clock()
        self._next = self._began + (FIRST_SECONDS if self._live else LINE_SECONDS)
        self._drawn = False

    def advance(self, done: float, failed: int = 0, more: str = "") -> None:
        """Update the number of its cases that are done, parts of one counted, and of failed ones. more: further text"""
        now = self.clock()
        if now < self._next or 0 < self._cases <= done:
            return
        elapsed = now - self._began
        self._next = now + (BAR_SECONDS if self._live else min(max(LINE_SECONDS, 0.2 * elapsed), SELDOM))
        text = status(
            self._name,
            done,
            self._cases,
            elapsed,
            bar=self._live,
            first=self._first,
            failed=failed,
            workers=self._workers,
            more=more,
        )
        if self._live:
            width = shutil.get_terminal_size().columns
            self.stream.write(f"\r{text[: width - 1]}\x1b[K")
        else:
            self.stream.write(text + "\n")
        self.stream.flush()
        self._drawn = True

    def end(self) -> None:
        """End the experiment; a bar is wiped away."""
        if self._live and self._drawn:
            self.stream.write("\r\x1b[K")
            self.stream.flush()


def status(
    name: str,
    done: float,
    cases: int,
    seconds: float,
    *,
    bar: bool,
    first: int = 0,
    failed: int = 0,
    workers: str = "",
    more: str = "",
) -> str:
    """One line: share, cases, failed ones, further text, rate, time left, workers. first: cases that were done when it
    began; cases: 0 where their number is not known."""
    share = done / cases if cases else 0.0
    drawn = ""
    if bar and cases:
        eighths = int(share * WIDTH * 8)
        full, rest = divmod(eighths, 8)
        drawn = "█" * full + (" ▏▎▍▌▋▊▉"[rest] if rest else "")
        drawn = drawn.ljust(WIDTH) + "▏ "
    text = f"{name}  {drawn}{100 * share:3.0f} %  {int(done):,} of {cases:,} cases" if cases else ""
    text = text or f"{name}  {int(done):,} case{'s' * (int(done) != 1)}"
    if failed:
        text += f", {failed:,} failed"
    if more:
        text += f", {more}"
    if done > first and seconds > 0.0:
        rate = (done - first) / seconds
        text += f"  {rate:,.3g} cases/s" if rate < 1000 else f"  {rate:,.0f} cases/s"
        text += f"  {duration((cases - done) / rate)} left" if cases else ""
    return f"{text}  {workers}" if workers else text
