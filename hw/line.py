"""A line to a bed: bytes go out, bytes come in. Beds over a wire know their line by these methods alone."""

from __future__ import annotations

import time
from typing import Protocol

BAUD = 921600
"""Bits a second of a serial line, unless a user says otherwise."""


class BedLine(Protocol):
    """A line to a bed. Its methods raise met.diagnostic.Problem E401 where it is lost."""

    def now(self) -> float:
        """The time of the line's clock, s."""

    def send(self, frame: bytes) -> None:
        """Send the bytes of a frame."""

    def receive(self, until: float) -> bytes:
        """The bytes that have come; where there are none, those that come first until this time of the line's clock,
        s; else b""."""

    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass on the line's clock."""

    def close(self) -> None:
        """Close the line."""


class HostClock:
    """The clock of this computer, by which lines of real devices go."""

    def now(self) -> float:
        return time.perf_counter()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


class LineOverLine:
    """The part of a line over another one that is the other's: its clock, and its end."""

    def __init__(self, line: BedLine) -> None:
        self._line = line

    def now(self) -> float:
        return self._line.now()

    def sleep(self, seconds: float) -> None:
        self._line.sleep(seconds)

    def close(self) -> None:
        self._line.close()


class TappedLine(LineOverLine):
    """A line that keeps all bytes that go over it: `sent`, and `came`."""

    def __init__(self, line: BedLine) -> None:
        super().__init__(line)
        self.sent, self.came = bytearray(), bytearray()

    def send(self, frame: bytes) -> None:
        self.sent += frame
        self._line.send(frame)

    def receive(self, until: float) -> bytes:
        data = self._line.receive(until)
        self.came += data
        return data
