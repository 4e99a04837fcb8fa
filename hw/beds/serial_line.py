"""A bed on a serial line, or on a substitute for one (hw/lines/serial_port.py)."""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable
from urllib.parse import urlsplit

from hw.bed import About, Capability
from hw.beds.wire import WireBed
from hw.line import BAUD, BedLine
from hw.lines.serial_port import SerialLine
from hw.lines.transcript import TranscribedLine, TranscriptWriter
from hw.ports import Opening, PortKind
from hw.protocol import messages
from met.diagnostic import Problem, error

LONGEST_SHARE = 0.8
"""Largest share of a period that the bytes of an exchange may take on the line (docs/protocol.md, Timing)."""
_LEAST_BYTES, _SENSOR_BYTES, _BITS = 16 + 17, 4, 10


class SerialBed(WireBed):
    """A bed on a serial line.

    url         a device, or another URL of pyserial's `serial_for_url`;  period: s from one exchange to the next
    transcript  takes the bytes of each record of a transcript (hw/lines/transcript.py); None: none is kept
    """

    def __init__(
        self, url: str, *, period: float, baud: int = BAUD, transcript: Callable[[bytes], object] | None = None
    ) -> None:
        self.unseen = "commands whose answers do not come over this line"
        super().__init__(url, period, secrets.randbelow(messages.NUMBERS))
        self.baud = baud
        header = {"line": url, "baud": baud, "period": period, "first": self._number}
        self._writer = None if transcript is None else TranscriptWriter(transcript, header)

    def connect(self) -> About:
        """Greet the bed. Raises Problem E405 where the line is too slow for the period."""
        about = super().connect()
        waits = Capability.LOCK_STEP not in about.capabilities and urlsplit(self._name).scheme not in ("socket", "unix")
        share = needed(about.capabilities, self.baud) / self.period
        if waits and share > LONGEST_SHARE:
            self.close()
            message = f"{self._name} at {self.baud} baud: an exchange takes {share:.0%} of its period of "
            message += f"{self.period * 1e3:.4g} ms, and {LONGEST_SHARE:.0%} is the most"
            least = least_baud(about.capabilities, self.period)
            raise Problem(error("E405", message, help=f"at least {least} baud, or a lower rate of the servo"))
        return about

    def open(self) -> BedLine:
        line = SerialLine(self._name, self.baud)
        self.warnings = line.warnings
        return line if self._writer is None else TranscribedLine(line, self._writer)

    def line_time(self, about: About) -> float:
        return 0.0 if "://" in self._name else needed(about.capabilities, self.baud)


def _opened_port(opening: Opening) -> SerialBed:
    port = opening.port
    return SerialBed(port.name, period=opening.period, baud=port.baud, transcript=opening.transcript())


PORT = PortKind(
    address="LINE",
    doc="A bed on a serial line, such as /dev/ttyUSB0, socket://HOST:PORT or another URL of pyserial.",
    open=_opened_port,
    recognizes=lambda name: True,
)


def exchanged(capabilities: Capability) -> int:
    """The number of bytes of an exchange, both ways together."""
    return _LEAST_BYTES + _SENSOR_BYTES * sum(reading in capabilities for reading in messages.READINGS)


def needed(capabilities: Capability, baud: int) -> float:
    """The time that the bytes of an exchange take on a serial line, s."""
    return _BITS * exchanged(capabilities) / baud


def least_baud(capabilities: Capability, period: float) -> int:
    """The least rate of a serial line for an exchange each period (s), bits a second."""
    return math.ceil(_BITS * exchanged(capabilities) / LONGEST_SHARE / period)
