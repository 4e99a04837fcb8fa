"""Frames of a CAN bus, the line that carries them, and how long they take on it."""

from __future__ import annotations

from typing import Protocol

from met.frozen import frozen

NOMINAL, FAST = 1_000_000, 5_000_000
"""Bits a second of a bus unless a bench says otherwise: of a classic frame, and of the data of a CAN-FD one."""

SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Lengths that a frame of CAN-FD may have."""


@frozen
class CanFrame:
    """A frame of a CAN bus.

    id      identifier, 11 bits, or 29 where it is `extended`
    remote  True for a request without data, which the node of that identifier answers
    fd      True for a frame of CAN-FD, up to 64 bytes
    time    when the interface received it, s of the line's clock; 0 for one that is to be sent
    time_unsure  s by which what it says may have been so before or after `time`, of a line that bounds that itself
    """

    id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    fd: bool = False
    time: float = 0.0
    time_unsure: float = 0.0


class CanLine(Protocol):
    """A line of CAN frames. Its methods raise met.diagnostic.Problem E401 where it is lost."""

    def now(self) -> float:
        """The time of the line's clock, s."""

    def send(self, frame: CanFrame) -> None:
        """Send a frame."""

    def receive(self, until: float) -> CanFrame | None:
        """The next frame that has come, or comes until this time of the line's clock, s; else None."""

    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass on the line's clock."""

    def close(self) -> None:
        """Close the line."""


def on_bus(frame: CanFrame, bitrate: float = NOMINAL, fast: float = FAST) -> float:
    """Longest time that a frame takes on the bus, s, all bits stuffed that can be (ISO 11898-1). `fast`: bits a second
    of the data of a CAN-FD frame."""
    length, head = len(frame.data), 20 if frame.extended else 0
    if not frame.fd:
        stuffed = 34 + head + 8 * length
        return (stuffed + (stuffed - 1) // 4 + 13) / bitrate
    arbitration = 17 + head + (16 + head) // 4 + 12
    data = 8 * length + 9
    check = 21 if length > 16 else 17
    return arbitration / bitrate + (data + (data - 1) // 4 + check + 4 + (check + 3) // 4 + 1) / fast
