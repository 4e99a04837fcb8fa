"""A moteus, as far as torques go: position mode without gains, its watchdog, faults, stopping and braking."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from hw.drives.drive import CanFrame
from tests.hw.players.player import PlayedDrive
from tests.hw.players.shaft import OFF, Output

_KINDS = {0: ("b", 1), 1: ("h", 2), 2: ("i", 4), 3: ("f", 4)}


def _subframes(data: bytes) -> tuple[dict[int, float], list[tuple[int, int, int]]]:
    """The values that a frame writes, by register, and its questions: head, first register, number. Raises IndexError,
    KeyError or struct.error for a truncated or invalid frame."""
    told: dict[int, float] = {}
    asked = []
    at = 0
    while at < len(data) and data[at] != 0x50:
        head = data[at]
        letter, size = _KINDS[head >> 2 & 3]
        count, at = head & 3, at + 1
        if not count:
            count, at = data[at], at + 1
        first, at = (data[at], at + 1) if data[at] < 0x80 else (data[at] & 0x7F | data[at + 1] << 7, at + 2)
        if head & 0xF0 == 0x00:
            told |= dict(enumerate(struct.unpack_from(f"<{count}{letter}", data, at), first))
            at += size * count
        elif head & 0xF0 == 0x10:
            asked.append((head, first, count))
        else:
            raise KeyError(head)
    return told, asked


class PlayedMoteus(PlayedDrive):
    """A moteus.

    watches  False for one whose watchdog does nothing
    brakes   what `servo.timeout_mode` has it do then: short its phases, 15; False: open them
    """

    def __init__(self, node: int, sense: int = 1, *, current_torque: float = 2.0, supply: float = 24.0) -> None:
        super().__init__(node, sense)
        self.current_torque, self.supply = current_torque, supply
        self.watches = self.brakes = True
        self.about = (4, 0x010304, 5)
        self.mode, self.fault, self.torque, self.until = 0, 0, 0.0, math.inf
        self.zero = 0.0

    def reboot(self) -> None:
        """Restart as after a loss of supply: its position begins at 0 again."""
        self.mode, self.fault, self.torque, self.zero = 0, 0, 0.0, self.angle

    def fail(self, fault: int) -> None:
        self.mode, self.fault, self.torque = 1, fault, 0.0

    @property
    def bridge(self) -> Output:
        if self.mode == 10:
            return Output("torque", self.torque)
        return Output("short") if self.mode == 15 or (self.mode == 11 and self.brakes) else OFF

    def receive(self, frame: CanFrame, now: float) -> Sequence[CanFrame]:
        if not frame.fd or frame.id & 0x7F != self.node or frame.id >> 16:
            return ()
        try:
            told, asked = _subframes(frame.data)
        except (IndexError, KeyError, struct.error):
            return ()
        self._obey(told, now)
        known = self._registers()
        answer = b""
        for head, first, count in asked:
            letter, _ = _KINDS[head >> 2 & 3]
            values = [float(known.get(n, 0.0)) for n in range(first, first + count)]
            numbered = bytes([first]) if first < 0x80 else bytes([first & 0x7F | 0x80, first >> 7])
            packed = struct.pack(f"<{count}{letter}", *(v if letter == "f" else int(v) for v in values))
            answer += bytes([0x20 | head & 0x0F]) + numbered + packed
        if not frame.id & 0x8000 or not answer:
            return ()
        size = next(each for each in (8, 12, 16, 20, 24, 32, 48, 64) if each >= len(answer))
        return (CanFrame(self.node << 8 | frame.id >> 8 & 0x7F, answer.ljust(size, b"\x50"), fd=True),)

    def _obey(self, told: dict[int, float], now: float) -> None:
        """Carry out a frame's writes. A fault, and the end of a command's time, can only be left by stopping."""
        if not math.isfinite(told.get(0, math.nan)):
            return
        mode = int(told[0])
        if mode == 0:
            self.mode, self.fault, self.torque = 0, 0, 0.0
        elif self.mode in (1, 11):
            return
        elif mode == 15:
            self.mode, self.torque = 15, 0.0
        elif mode == 10:
            most = min(told.get(0x25, math.inf), self.current_torque)
            loose = told.get(0x23, 1.0) == told.get(0x24, 1.0) == told.get(0x2B, 1.0) == 0.0
            self.mode, self.torque = 10, min(max(told.get(0x22, 0.0), -most), most) if loose else 0.0
            self.until = now + told.get(0x27, math.inf)

    def _registers(self) -> dict[int, float]:
        """Values of the registers that it has, by number; others are 0."""
        turns = 2.0 * math.pi
        return {
            0x00: self.mode,
            0x01: (self.angle - self.zero) / turns,
            0x02: self.rate / turns,
            0x07: self.bridge.value * self.rate,
            0x0D: self.supply,
            0x0F: self.fault,
            **{0x100 + n: value for n, value in enumerate(self.about)},
        }

    def tick(self, now: float) -> Sequence[CanFrame]:
        if self.mode == 10 and self.watches and now > self.until:
            self.mode, self.torque = 11, 0.0
        if self.mode in (10, 15) and self.supply > 46.0:
            self.fail(34)
        return ()
