"""A line to a bed: bytes go out, bytes come in. Beds over a wire know their line by these methods alone."""

from __future__ import annotations

from typing import Protocol

BAUD = 921600
"""Bits a second of a serial line, unless a user says otherwise."""


class BedLine(Protocol):
    """Raises met.diagnostic.Problem E401 where it is lost."""

    def now(self) -> float:
        """Its clock, s."""

    def send(self, frame: bytes) -> None: ...

    def receive(self, until: float) -> bytes:
        """What has come, at once; else what comes first until that time of its clock; else nothing."""

    def sleep(self, seconds: float) -> None:
        """Let its clock go on by so many."""

    def close(self) -> None: ...


class TappedLine:
    """A line, and all that went over it. sent, came: bytes"""

    def __init__(self, line: BedLine) -> None:
        self._line = line
        self.sent, self.came = bytearray(), bytearray()

    def now(self) -> float:
        return self._line.now()

    def send(self, frame: bytes) -> None:
        self.sent += frame
        self._line.send(frame)

    def receive(self, until: float) -> bytes:
        data = self._line.receive(until)
        self.came += data
        return data

    def sleep(self, seconds: float) -> None:
        self._line.sleep(seconds)

    def close(self) -> None:
        self._line.close()
