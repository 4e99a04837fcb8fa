"""mjbots' fdcanusb, a USB adapter to a CAN-FD bus that speaks text over a serial line, each command and frame a line.

    can off, can on     leave the bus, so that its speeds can be set, and enter it
    conf set NAME N     set can.bitrate or can.fd_bitrate; not saved here
    can std ID DATA FLAGS, can ext ...    send a frame; B: with a fast part, F: of CAN-FD, R: a request; else b f r
    OK, ERR why         the answer to each command
    rcv ID DATA FLAGS   a frame has come; E: its identifier has 29 bits

Facts are from the maker's description and firmware; no adapter was there. A line has no checksum, and the firmware cuts
lines short where its buffer is full: what is not a whole line of a frame that there can be is dropped, as a bus drops
a frame. It tells no time. A frame's is when its line was read, but at most `TURN` after the `OK` before it: bytes that
were held up come together, and would else pass for answers to what was asked since. Where that `OK` itself was late,
nobody knows when the frame came, and it is stamped as if it had come before it was asked for.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Mapping
from typing import Any

from hw.drives.bench_file import SPEEDS
from hw.drives.drive import SIZES, CanFrame
from hw.line import BedLine, LineOverLine
from met.diagnostic import Problem, error

ANSWERED = 1.0
"""Longest time for an answer while the adapter is opened, s."""

QUIET = 0.05
"""Time for which the line must be quiet before the adapter is addressed, s: earlier output has ended."""

TURN = 7e-4
"""Longest time from the `OK` of a command to the frames that answer it, s: four classic frames."""

LATE = 1e-3
"""Longest time from a command to its `OK` by which it is still known when it was sent on, s."""

OWED = 0.01
"""Time after which an `OK` that has not come never does, s."""

LONGEST_LINE = 512
"""Largest length of a line in bytes: one of 64 bytes of data has 160."""

LATE_READS = 16
"""Largest number of reads after the end of a wait, for bytes that do not make a frame."""

LOST = (
    "the drives stop themselves when they hear nothing for the time of their watchdog",
    "look at the adapter, the cable and its two terminators, then start again",
)

_FRAME = re.compile(rb"rcv ([0-9A-F]{1,8}) ((?:[0-9A-F]{2})*) ([EeBbFfRr](?: [EeBbFfRr]){3})((?: [tfx]-?[0-9A-F]+)*)")


class FdcanusbLine(LineOverLine):
    """A CAN bus behind an fdcanusb, open as soon as it is made. Making it raises Problem E400, its methods raise E401.

    line      carries the adapter's bytes
    settings  `[bus]` of a bench file: channel, and the speeds that are to be set
    refused   commands that the adapter did not take: frames that were not sent
    """

    def __init__(self, line: BedLine, settings: Mapping[str, Any]) -> None:
        super().__init__(line)
        self._name = str(settings["channel"])
        self._rest, self._lines, self._frames = b"", deque[bytes](), deque[CanFrame]()
        self.refused = 0
        self._sent = deque[float]()
        """Times of commands without an answer yet, s."""
        self._sent_at = self._taken_at = 0.0
        """Times of the last answered command, and of its answer, s."""
        try:
            self._open({name: settings[key] for key, name in SPEEDS.items() if key in settings})
        except BaseException:
            line.close()
            raise

    def send(self, frame: CanFrame) -> None:
        """Send a frame as a line of the adapter's text. Raises Problem E404 for one without data."""
        if not frame.data:
            message = f"an fdcanusb, on {self._name}, cannot send a frame without data, as these drives need"
            helps = "moteus, Damiao and RobStride need none; for the others another adapter"
            raise Problem(error("E404", message, help=helps))
        self._forget(now := self._line.now())
        self._sent.append(now)
        kind, flags = "ext" if frame.extended else "std", "B F r" if frame.fd else "b f r"
        self._line.send(f"can {kind} {frame.id:X} {frame.data.hex().upper()} {flags}\n".encode())

    def receive(self, until: float) -> CanFrame | None:
        """The next frame that comes before the time `until`, s; None where none does."""
        late = 0
        while not self._frames:
            data = self._line.receive(until)
            now = self._line.now()
            self._keep(data)
            while self._lines:
                self._take(self._lines.popleft(), now)
            late += now >= until
            if late and (not data or late > LATE_READS):
                break
        return self._frames.popleft() if self._frames else None

    def _keep(self, data: bytes) -> None:
        """Cut the input into lines."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._lines += [line.strip(b"\r") for line in lines if len(line) <= LONGEST_LINE]
        if len(self._rest) > LONGEST_LINE:  # after its end a new line begins
            self._rest = bytes(LONGEST_LINE + 1)

    def _take(self, text: bytes, time: float) -> None:
        """Take a line of the adapter: a confirmation, an error, or a received frame. Raises Problem E401 where it is
        off the bus."""
        if text == b"OK" or text.startswith(b"ERR"):
            self._forget(time)
            if self._sent:
                self._sent_at, self._taken_at = self._sent.popleft(), time
        if text.startswith(b"ERR"):
            if b"not in BusOn" in text:
                message = f"the fdcanusb on {self._name} is off its bus: it was switched on anew, or the bus has errors"
                raise Problem(error("E401", message, help=LOST))
            self.refused += 1
        elif (frame := frame_of(text, self._came(time))) is not None:
            self._frames.append(frame)

    def _forget(self, time: float) -> None:
        """Expect no answer any more to commands that were given too long before a time, s."""
        while self._sent and time - self._sent[0] > OWED:
            self._sent.popleft()

    def _came(self, time: float) -> float:
        """The arrival time of a frame whose line was read at a time, s."""
        if self._taken_at - self._sent_at > LATE:
            return self._sent_at - LATE
        return min(time, self._taken_at + TURN)

    def _open(self, speeds: Mapping[str, int]) -> None:
        """Set the bus's speeds and enter it. Raises Problem E400 where the device is not an fdcanusb."""
        self._line.send(b"\n")  # ends a line that somebody else may have begun
        end = self.now() + ANSWERED
        while self._line.receive(self.now() + QUIET) and self.now() < end:
            pass
        self._command("can off", "ERR already in BusOff")
        for name, value in speeds.items():
            self._command(f"conf set {name} {value}")
        self._command("can on")

    def _command(self, command: str, *also: str) -> None:
        """Send a command, and check that the answer is OK or equivalent."""
        self._line.send(f"{command}\n".encode())
        end, came = self.now() + ANSWERED, b""
        while self.now() < end:
            self._keep(self._line.receive(end))
            while self._lines:
                text = self._lines.popleft()
                if text.decode("ascii", "replace") in ("OK", *also):
                    return
                if text.startswith(b"ERR"):
                    came, end = text, self.now()
                    break
                came = came or text
        came, self._rest = came or self._rest, b""
        answer = "".join(
            character if character.isprintable() else "?" for character in came[:60].decode("ascii", "replace")
        )
        message = f"no fdcanusb answers `{command}` on {self._name}: {f'`{answer}` came' if answer else 'nothing came'}"
        helps = (
            "`channel` of `[bus]`: the adapter's device, such as /dev/fdcanusb or /dev/ttyACM0",
            "an adapter of another kind has another `interface`: slcan, socketcan, pcan ...",
        )
        raise Problem(error("E400", message, help=helps))


def frame_of(text: bytes, time: float) -> CanFrame | None:
    """The frame that a line of an adapter says has come at a time, s; None where it is no whole line of a frame."""
    match_ = _FRAME.fullmatch(text)
    if match_ is None:
        return None
    number, data, flags = int(match_[1], 16), bytes.fromhex(match_[2].decode()), match_[3].decode().split()
    if sorted(flag.upper() for flag in flags) != ["B", "E", "F", "R"]:
        return None
    extended, fd = "E" in flags, "F" in flags
    if number >= 1 << (29 if extended else 11) or len(data) not in SIZES or (len(data) > 8 and not fd):
        return None
    return CanFrame(number, data, extended, "R" in flags, fd, time)
