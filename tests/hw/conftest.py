"""Beds for the tests of this folder, over pseudo-terminals and lines with clocks of their own."""

from __future__ import annotations

import os
import re
import tty
from collections.abc import Callable, Iterator

import pytest

from hw.beds.wire import WireBed
from hw.line import BedLine
from hw.lines.transcript import TranscribedLine, TranscriptWriter
from met.diagnostic import Problem
from met.messages.render import render
from tests.hw.device import Device
from tests.hw.relay import Faults, Relay


class LineBed(WireBed):
    """A bed on the lines that `open_line` gives; its transcript, where asked for, in `records`."""

    def __init__(
        self, open_line: Callable[[], BedLine], period: float = 1e-3, first: int = 100, recorded: bool = False
    ) -> None:
        super().__init__("a line", period, first)
        self._open_line = open_line
        self.records: list[bytes] = []
        header = {"line": "a line", "period": period, "first": first}
        self._writer = TranscriptWriter(self.records.append, header) if recorded else None

    def open(self) -> BedLine:
        line = self._open_line()
        return line if self._writer is None else TranscribedLine(line, self._writer)

    @property
    def number(self) -> int:
        """Of the last frame."""
        return self._number


@pytest.fixture
def precedence() -> Iterator[None]:
    """Over other processes, where it is allowed: a bed with a time of its own does not wait for a busy machine."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except OSError:
        yield
        return
    yield
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@pytest.fixture
def on_pty() -> Iterator[Callable[..., str]]:
    """(device, faults) -> the name of a pseudo-terminal at whose other end the device is."""
    relays, files = [], []

    def open_one(device: Device, faults: Faults | None = None) -> str:
        host, own = os.openpty()
        tty.setraw(own)
        files.extend((host, own))
        relays.append(Relay(host, device, faults))
        return os.ttyname(own)

    yield open_one
    for relay in relays:
        relay.close()
    for file in files:
        os.close(file)


def said(problem: Problem) -> str:
    """As the command line prints it, without the count."""
    return re.sub(r"\n*\d+ errors?\n\Z", "", render(problem.diagnostics, problem.sources)).rstrip("\n")


def refusal(do: Callable[[], object]) -> str:
    """What is said where something is refused."""
    with pytest.raises(Problem) as caught:
        do()
    return said(caught.value)
