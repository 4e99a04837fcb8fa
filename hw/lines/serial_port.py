"""A serial line, or a pyserial substitute: a device, socket://, rfc2217://; and unix://PATH, a socket of this machine,
such as an emulator's."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import io
import os
import re
import select
import socket
import termios
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from hw.line import HostClock
from met.diagnostic import Diagnostic, Problem, error

_WRITE_TIMEOUT = 1.0
"""s that bytes may wait to be sent before the line counts as hanging. pyserial counts a busy machine's delays
too."""

_UNIX = "unix://"
_NETWORK = ("socket", "rfc2217")

_SLICE = 0.001
"""s between two looks at a line that the system cannot wait for."""

_MOST_FILES = 4096
"""Number of open files among which a line that is open already is looked for."""

ADAPTERS = Path("/sys/bus/usb-serial/devices")
_SLOW_ADAPTER = 2
"""Longest time in ms for which a USB adapter may keep bytes back without a warning."""


LOST = (
    "the bed stops itself when it hears nothing for the time of its deadman",
    "look at the cable and the bed's supply, then start again: nothing goes on by itself",
)
"""Remedy where the line to a bed was lost."""


class SerialLine(HostClock):
    """A serial line, open as soon as it is made. Making it raises Problem E400, its methods raise E401.

    A device is open for this process alone: the system lets no other open it then (TIOCEXCL), but one of the
    superuser's, or one that had it open before; and none of those that lock it (flock). What is behind a socket:// or
    rfc2217:// its server gives to whom it likes.

    to, lost  what is at its other end, and what to do where it was lost, in words
    """

    def __init__(self, url: str, baud: int, to: str = "the bed", lost: Sequence[str] = LOST) -> None:
        """Open the line for this process alone. baud: bits a second. Raises Problem E400."""
        self._url, self._to, self._helps = url, to, tuple(lost)
        local = "://" not in url
        try:
            self._port: Any = _opened(url, baud)
        except (OSError, ValueError, KeyError, re.error) as reason:  # the last two are pyserial's, about a URL
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
        self._exclude(termios.TIOCEXCL)

    def _exclude(self, request: int) -> None:
        """Let others open the device no more, TIOCEXCL, or again, TIOCNXCL."""
        with contextlib.suppress(OSError):  # as of a socket
            if self._file is not None:
                fcntl.ioctl(self._file, request)

    @property
    def file(self) -> int | None:
        """The number of its file, by which the system can wait for it; None where it has none."""
        return self._file

    def send(self, frame: bytes) -> None:
        try:
            self._port.write(frame)
        except OSError as reason:
            raise self._lost(reason) from None

    def receive(self, until: float) -> bytes:
        """The bytes that come before the time `until`, s; none where none do. Raises Problem E401."""
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

    def close(self) -> None:
        # pyserial does not close a socket whose other end has gone
        connection = getattr(self._port, "_socket", None)
        self._exclude(termios.TIOCNXCL)
        with contextlib.suppress(OSError):
            self._port.close()
        if connection is not None:
            connection.close()

    def _lost(self, reason: OSError) -> Problem:
        message = f"the line to {self._to} on {self._url} was lost: {_why(reason)}"
        return Problem(error("E401", message, help=self._helps))


def _opened(url: str, baud: int) -> Any:
    """The port of a URL or device, open. Raises OSError, ValueError and what pyserial raises."""
    if url.startswith(_UNIX):
        return _UnixSocket(url.removeprefix(_UNIX))
    _check_address(url)
    import serial  # imported only to drive a bed

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
        """Read pending bytes, without waiting."""
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
    """The error that a line cannot be opened, with the system's reason and what to do."""
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
        for number in range(3, _MOST_FILES):
            with contextlib.suppress(OSError):
                if wanted and os.fstat(number).st_rdev == wanted:
                    return True
    return False


def _ports() -> str:
    """The serial devices of this machine, in words."""
    from serial.tools.list_ports import comports

    devices = [port.device for port in comports()]
    return (
        f"serial lines here: {', '.join(devices)}" if devices else "there is no serial line on this machine: plug it in"
    )


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
    for exception in _chain(reason):
        if isinstance(exception, socket.gaierror) and exception.strerror:
            return exception.strerror.lower()
        if isinstance(exception, ValueError):
            reason = exception
    return " ".join(str(reason).split())


def _number(reason: BaseException | None) -> int | None:
    """The system's error number, of an error that pyserial raised or of its cause; None where there is none."""
    for exception in _chain(reason):
        number = exception.args[0] if isinstance(exception, termios.error) else getattr(exception, "errno", None)
        if number:
            return int(number)
    return None


def _chain(reason: BaseException | None) -> Iterator[BaseException]:
    """An error, and the errors from which it came."""
    while reason is not None:
        yield reason
        reason = reason.__context__
