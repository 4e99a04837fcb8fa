"""A bed on a serial line, or on what pyserial makes one of: a device, socket://, rfc2217://. And on unix://PATH, a
socket of this machine, such as an emulator's.
"""

from __future__ import annotations

import contextlib
import errno
import io
import math
import os
import re
import secrets
import select
import socket
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from hw.bed import About, Capability
from hw.beds.wire import WireBed
from hw.line import BAUD, BedLine
from hw.ports import Opening, PortKind
from hw.protocol import messages
from hw.transcript import TranscribedLine, TranscriptWriter
from met.diagnostic import Diagnostic, Problem, error

LONGEST_SHARE = 0.8
"""Largest share of a period that the bytes of an exchange may take on the line (docs/protocol.md, Timing)."""
_LEAST_BYTES, _SENSOR_BYTES, _BITS = 16 + 17, 4, 10

_WRITE_TIMEOUT = 1.0
"""s that 16 bytes may wait to be sent before the line counts as hanging. pyserial counts a busy machine's delays
too."""

_UNIX = "unix://"
_NETWORK = ("socket", "rfc2217")

_SLICE = 0.001
"""s between two looks at a line that the system cannot wait for."""

ADAPTERS = Path("/sys/bus/usb-serial/devices")
_SLOW_ADAPTER = 2
"""Longest time in ms for which a USB adapter may keep bytes back without a warning."""


class SerialBed(WireBed):
    """A bed on a serial line.

    url         a device, or another URL of pyserial's `serial_for_url`;  period: s from one exchange to the next
    transcript  takes the bytes of each record of a transcript (hw/transcript.py); None: none is kept
    """

    def __init__(
        self, url: str, *, period: float, baud: int = BAUD, transcript: Callable[[bytes], object] | None = None
    ) -> None:
        super().__init__(url, period, secrets.randbelow(messages.NUMBERS))
        self.baud = baud
        header = {"line": url, "baud": baud, "period": period, "first": self._number}
        self._writer = None if transcript is None else TranscriptWriter(transcript, header)

    def connect(self) -> About:
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
    return _LEAST_BYTES + _SENSOR_BYTES * sum(each in capabilities for each in messages.READINGS)


def needed(capabilities: Capability, baud: int) -> float:
    """The time that the bytes of an exchange take on a serial line, s."""
    return _BITS * exchanged(capabilities) / baud


def least_baud(capabilities: Capability, period: float) -> int:
    """The least rate of a serial line for an exchange each period (s), bits a second."""
    return math.ceil(_BITS * exchanged(capabilities) / LONGEST_SHARE / period)


class SerialLine:
    """A serial line, open as soon as it is made. Making it raises Problem E400, its methods raise E401."""

    def __init__(self, url: str, baud: int) -> None:
        self._url = url
        local = "://" not in url
        try:
            self._port: Any = _opened(url, baud)
        except (OSError, ValueError, KeyError, re.error) as reason:  # the last two are pyserial's, of what a URL says
            raise _not_opened(url, reason) from None
        try:
            self._file: int | None = self._port.fileno()
        except (AttributeError, io.UnsupportedOperation):
            self._file = None  # such a port cannot be waited for
            self._port.timeout = _SLICE
        # a pseudo-terminal refuses it with ValueError, others have none
        with contextlib.suppress(AttributeError, NotImplementedError, ValueError, OSError):
            self._port.set_low_latency_mode(True)
        self.warnings = latency(url) if local else ()

    def now(self) -> float:
        return time.perf_counter()

    def send(self, frame: bytes) -> None:
        try:
            self._port.write(frame)
        except OSError as reason:
            raise self._lost(reason) from None

    def receive(self, until: float) -> bytes:
        port = self._port
        try:
            if self._file is not None:
                select.select((self._file,), (), (), max(0.0, until - time.perf_counter()))
                return bytes(port.read(4096))
            while True:
                data = bytes(port.read(1))
                if data:
                    return data + bytes(port.read(port.in_waiting))
                if time.perf_counter() >= until:
                    return b""
        except OSError as reason:
            raise self._lost(reason) from None

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)

    def close(self) -> None:
        # pyserial does not close a socket whose other end has gone
        connection = getattr(self._port, "_socket", None)
        with contextlib.suppress(OSError):
            self._port.close()
        if connection is not None:
            connection.close()

    def _lost(self, reason: OSError) -> Problem:
        helps = (
            "the bed stops itself when it hears nothing for the time of its deadman",
            "look at the cable and the bed's supply, then start again: nothing goes on by itself",
        )
        return Problem(error("E401", f"the line to the bed on {self._url} was lost: {_why(reason)}", help=helps))


def _opened(url: str, baud: int) -> Any:
    if url.startswith(_UNIX):
        return _UnixSocket(url.removeprefix(_UNIX))
    _check_address(url)
    import serial  # only who drives a bed pays for it

    own = {} if "://" in url else {"exclusive": True}
    return serial.serial_for_url(url, baudrate=baud, timeout=0, write_timeout=_WRITE_TIMEOUT, **own)


def _check_address(url: str) -> None:
    """Raise Problem E400 where the URL of a network line names no host or no port."""
    scheme = url.partition("://")[0]
    if scheme not in _NETWORK:
        return
    try:
        parts = urlsplit(url)
        wrong = "it names no host" if not parts.hostname else "it names no port" if not parts.port else ""
    except ValueError:  # as of a port that is no number
        wrong = "it is no address of a host and a port"
    if wrong:
        helps = f"write `{scheme}://HOST:PORT`, where PORT is 1 to 65535"
        raise Problem(error("E400", f"{url} cannot be opened: {wrong}", help=helps))


class _UnixSocket:
    """A UNIX socket with those methods of a pyserial port that `SerialLine` uses: pyserial has none for it."""

    def __init__(self, path: str) -> None:
        self._line = socket.socket(socket.AF_UNIX)
        try:
            self._line.connect(path)
        except OSError:
            self._line.close()
            raise
        self._line.setblocking(False)

    def fileno(self) -> int:
        return self._line.fileno()

    def write(self, data: bytes) -> None:
        if not select.select((), (self._line,), (), _WRITE_TIMEOUT)[1]:
            raise TimeoutError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))
        self._line.sendall(data)

    def read(self, size: int) -> bytes:
        """Read what is there, without waiting."""
        try:
            data = self._line.recv(size)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionResetError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
        return data

    def close(self) -> None:
        self._line.close()


def _not_opened(url: str, reason: Exception) -> Problem:
    number, why = _number(reason), _why(reason)
    if number == errno.ENOTTY:
        why, helps = "it is no serial line", [_ports()]
        if os.path.isfile(url):
            why = "it is a file, and no transcript, which could be replayed"
    elif number == errno.EACCES:
        helps = ["`sudo usermod -a -G dialout $USER` lets you use serial lines, once you have logged in again"]
    elif number in (errno.EAGAIN, errno.EBUSY) and _is_ours(url):
        why, helps = "this run has it open already", ["each bed is on a line of its own: give each joint another port"]
    elif number in (errno.EAGAIN, errno.EBUSY):
        helps = [f"another program uses it; `fuser -v {url}` says which"]
    elif isinstance(reason, ValueError | KeyError):
        helps = ["such as /dev/ttyUSB0, socket://HOST:PORT or rfc2217://HOST:PORT"]
    elif "://" in url and not url.startswith(_UNIX):
        helps = ["is there someone who listens at that address?"]
    elif url.startswith(_UNIX):
        helps = ["is there someone who made that socket, and listens?"]
    else:
        helps = [_ports()]
    return Problem(error("E400", f"{url} cannot be opened: {why}", help=helps))


def _is_ours(path: str) -> bool:
    """True where this process has the same device open, other than as its terminal."""
    with contextlib.suppress(OSError):
        wanted = os.stat(path).st_rdev
        for name in os.listdir("/proc/self/fd"):
            with contextlib.suppress(OSError):
                if int(name) > 2 and wanted and os.fstat(int(name)).st_rdev == wanted:
                    return True
    return False


def _ports() -> str:
    from serial.tools.list_ports import comports

    found = [port.device for port in comports()]
    return f"serial lines here: {', '.join(found)}" if found else "there is no serial line on this machine: plug it in"


def latency(url: str) -> tuple[Diagnostic, ...]:
    """A warning where a USB adapter keeps bytes back. Its setting is lost when the adapter is plugged in again."""
    file = ADAPTERS / Path(url).resolve().name / "latency_timer"
    try:
        ms = int(file.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return ()
    if ms <= _SLOW_ADAPTER:
        return ()
    helps = (f"`echo 1 | sudo tee {file}`, after each time that it is plugged in",)
    message = f"the adapter of {url} keeps bytes back for up to {ms} ms: exchanges will be late"
    return (Diagnostic("E405", message, help=helps, severity="warning"),)


def _why(reason: Exception) -> str:
    """The reason of an error in words: the system's where there is an error number, else those of its first cause."""
    number = _number(reason)
    if number and number > 0:
        return os.strerror(number).lower()
    for each in _chain(reason):
        if isinstance(each, socket.gaierror) and each.strerror:
            return each.strerror.lower()
        if isinstance(each, ValueError):
            reason = each
    return " ".join(str(reason).split())


def _number(reason: BaseException | None) -> int | None:
    """The system's error number, of an error that pyserial raised or of its cause; None where there is none."""
    for each in _chain(reason):
        number = each.args[0] if isinstance(each, termios.error) else getattr(each, "errno", None)
        if number:
            return int(number)
    return None


def _chain(reason: BaseException | None) -> Iterator[BaseException]:
    """An error, and the errors from which it came."""
    while reason is not None:
        yield reason
        reason = reason.__context__
