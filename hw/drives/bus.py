"""A CAN bus by python-can, whatever interface it has: socketcan, slcan, PCAN ..., or the virtual ones of the library;
or by an adapter that the library has not, an fdcanusb; or the serial lines of two drives in its place.

python-can is MET's extra `can`, and is imported when a bus is opened.
"""

from __future__ import annotations

import contextlib
import select
import time
from collections.abc import Mapping
from typing import Any

from hw.drives.bench_file import FDCANUSB, SERIAL
from hw.drives.drive import CanFrame, CanLine
from hw.drives.fdcanusb import LOST, FdcanusbLine
from hw.drives.odrive_lines import PULLED, OdriveLines
from hw.line import BAUD, HostClock
from hw.lines.serial_port import SerialLine
from met.diagnostic import Problem, error


def open_bus(settings: Mapping[str, Any]) -> CanLine:
    """The bus that `[bus]` of a bench file describes, open. Raises Problem E400 or E449."""
    if settings["interface"] == SERIAL:
        ports, baud = settings["ports"], settings["baud"]
        return OdriveLines(SerialPair(ports, baud or BAUD), tuple(ports), baud)
    if settings["interface"] != FDCANUSB:
        return PythonCanLine(settings)
    return FdcanusbLine(SerialLine(str(settings["channel"]), BAUD, "the fdcanusb", LOST), settings)


class PythonCanLine(HostClock):
    """A bus of python-can, open as soon as it is made. Making it raises Problem E400 or E449, its methods raise E401.

    settings  what `can.Bus` is called with: interface, channel, bitrate ...
    """

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self._name = f"{settings.get('interface')}:{settings.get('channel')}"
        try:
            import can
        except ModuleNotFoundError:
            install = "`pip install python-can`; with `scripts/met`, `.venv/bin/pip install python-can`"
            wrong = error("E449", "a bench on a CAN bus needs python-can, which is not here", help=install)
            raise Problem(wrong) from None
        self._failures = (can.CanError, OSError)
        self._message = can.Message
        try:
            self._bus: Any = can.Bus(**settings)
        except Exception as reason:  # its own library may raise anything, or be missing
            helps = ("is the interface up? `ip link set can0 up type can bitrate 1000000`", "`interface` and `channel`")
            message = f"CAN bus {self._name} cannot be opened: {' '.join(str(reason).split()) or type(reason).__name__}"
            raise Problem(error("E400", message, help=helps)) from None
        self._offset = time.perf_counter() - time.time()  # interfaces stamp frames by the time of day

    def send(self, frame: CanFrame) -> None:
        """Send a frame. Raises Problem E401."""
        message = self._message(
            arbitration_id=frame.id,
            data=frame.data,
            is_extended_id=frame.extended,
            is_remote_frame=frame.remote,
            is_fd=frame.fd,
            bitrate_switch=frame.fd,
        )
        try:
            self._bus.send(message, timeout=0.01)
        except self._failures as reason:
            raise self._lost(reason) from None

    def receive(self, until: float) -> CanFrame | None:
        """The next frame that comes before the time `until` of the line's clock, s; None where none does. Raises
        Problem E401."""
        while True:
            try:
                message = self._bus.recv(max(0.0, until - time.perf_counter()))
            except self._failures as reason:
                raise self._lost(reason) from None
            if message is None:
                return None
            if message.is_error_frame:
                continue
            now = time.perf_counter()
            stamp = message.timestamp + self._offset
            came = stamp if now - 1.0 < stamp < now else now  # an interface with a clock of its own tells nothing here
            return CanFrame(
                message.arbitration_id,
                bytes(message.data),
                message.is_extended_id,
                message.is_remote_frame,
                message.is_fd,
                came,
            )

    def close(self) -> None:
        with contextlib.suppress(*self._failures):
            self._bus.shutdown()

    def _lost(self, reason: Exception) -> Problem:
        """The error that the bus was lost (E401)."""
        helps = (
            "the drives stop themselves when they hear nothing for the time of their watchdog",
            "look at the cable, its two terminators and the interface, then start again",
        )
        message = f"CAN bus {self._name} was lost: {' '.join(str(reason).split()) or type(reason).__name__}"
        return Problem(error("E401", message, help=helps))


class SerialPair(HostClock):
    """The bytes of serial lines, as frames whose identifier is the number of the line's drive, however they are cut.
    Making it raises Problem E400, its methods raise E401.

    ports  by number
    """

    def __init__(self, ports: Mapping[int, str], baud: int) -> None:
        self._lines: dict[int, SerialLine] = {}
        try:
            for number, port in ports.items():
                self._lines[number] = SerialLine(port, baud, "a drive", PULLED)
        except BaseException:
            self.close()
            raise

    def send(self, frame: CanFrame) -> None:
        self._lines[frame.id].send(frame.data)

    def receive(self, until: float) -> CanFrame | None:
        """The next bytes of either line as a frame, by its drive's number; None where none come before the time
        `until`, s."""
        files = [line.file for line in self._lines.values() if line.file is not None]
        while True:
            if len(files) == len(self._lines):
                select.select(files, (), (), max(0.0, until - time.perf_counter()))
            for number, line in self._lines.items():  # one that cannot be waited for is polled
                if data := line.receive(0.0):
                    return CanFrame(number, data, time=time.perf_counter())
            if time.perf_counter() >= until:
                return None

    def close(self) -> None:
        for line in self._lines.values():
            line.close()
