"""A RobStride drive in its operation mode and its own protocol, after its maker's manual."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from hw.drives.drive import CanFrame
from tests.hw.players.player import PlayedDrive
from tests.hw.players.shaft import OFF, Output

_FORMATS = {0x7005: "<B", 0x700B: "<f", 0x701C: "<f", 0x7028: "<I"}
_ANGLE = 0x7019
_HOST = 0xFD


class PlayedRobstride(PlayedDrive):
    """A RobStride drive.

    rate_max, torque_max  where its fields end, rad/s and N m: those of an RS05
    watches     False for one whose watchdog does nothing
    wraps       False for one whose angle stays at the end of its range, as of older firmware
    keeps       True for one that goes on with the torque that it was told last once it is enabled
    takes_off   True for one that takes a torque while it is off
    angle_max   rad, where its angle's field ends
    version     of its firmware; None: it does not say
    parameters  by number, but for its angle
    faults      bits of an answer;  mode: 0 reset, 2 running
    """

    def __init__(self, node: int, sense: int = 1, *, rate_max: float = 50.0, torque_max: float = 5.5) -> None:
        super().__init__(node, sense)
        self.rate_max, self.torque_max, self.angle_max = rate_max, torque_max, 4.0 * math.pi
        self.watches = self.wraps = True
        self.keeps = self.takes_off = False
        self.version: tuple[int, ...] | None = (0, 3, 1, 44)
        self.parameters: dict[int, float] = {0x7005: 5, 0x700B: torque_max, 0x701C: 24.0, 0x7028: 0}
        self.refuses: set[int] = set()
        self.mode, self.faults, self.torque, self.fed, self.zero = 0, 0, 0.0, 0.0, 0.0
        self._said: list[CanFrame] = []

    def reboot(self) -> None:
        """Restart as after a loss of supply: unsaved values are gone, and its angle begins within a turn."""
        self.mode, self.faults, self.torque = 0, 0, 0.0
        self.parameters |= {0x7005: 0, 0x7028: 0}
        self.zero += 2.0 * math.pi * math.floor((self.angle - self.zero) / (2.0 * math.pi))

    def fail(self, faults: int, told: int = 0) -> None:
        """Stop by faults: bits of an answer, and of a frame of their own."""
        self.mode, self.faults = 0, self.faults | faults
        self.torque *= self.keeps
        if told:
            number = 21 << 24 | self.node << 8 | _HOST
            self._said.append(CanFrame(number, struct.pack("<II", told, 0), extended=True))

    @property
    def bridge(self) -> Output:
        return Output("torque", self.torque) if self.mode == 2 else OFF

    def receive(self, frame: CanFrame, now: float) -> Sequence[CanFrame]:
        if not frame.extended or frame.fd or frame.remote or frame.id & 0xFF != self.node or len(frame.data) != 8:
            return ()
        self.fed = now
        kind, middle, data = frame.id >> 24 & 0x1F, frame.id >> 8 & 0xFFFF, frame.data
        if kind == 0:
            return (CanFrame(self.node << 8 | 0xFE, b"ROBSTRID"[:7] + bytes([self.node]), extended=True),)
        if kind == 17:
            return (self._parameter(struct.unpack_from("<H", data)[0], data),)
        if kind == 1:
            if (self.mode == 2 or self.takes_off) and self.parameters[0x7005] == 0:
                gains = struct.unpack_from(">HH", data, 4)
                most = self.parameters[0x700B]
                torque = middle / 65535 * 2.0 * self.torque_max - self.torque_max
                self.torque = min(max(torque, -most), most) if gains == (0, 0) else 0.0
        elif kind == 3:
            if not self.faults:
                self.mode = 2
                self.torque *= self.keeps
        elif kind == 4:
            self.mode = 0
            self.torque *= self.keeps
            if data[0] == 1:
                self.faults = 0
            elif data[1] == 0xC4 and self.version is not None:
                return (self._feedback(bytes((0, 0xC4, 0x56, *self.version)).ljust(8, b"\0")),)
        elif kind == 18:
            number = struct.unpack_from("<H", data)[0]
            if number in self.parameters and number not in self.refuses:
                self.parameters[number] = struct.unpack_from(_FORMATS[number], data, 4)[0]
        else:
            return ()
        return (self._feedback(),)

    def _parameter(self, number: int, data: bytes) -> CanFrame:
        value = b""
        if number == _ANGLE:
            value = struct.pack("<f", self.angle - self.zero)
        elif number in self.parameters:
            kind = _FORMATS[number]
            found = self.parameters[number]
            value = struct.pack(kind, found if kind == "<f" else int(found))
        status = 0 if value else 1
        answer = data[:4] + value.ljust(4, b"\0")
        return CanFrame(17 << 24 | status << 16 | self.node << 8 | _HOST, answer, extended=True)

    def _feedback(self, data: bytes = b"") -> CanFrame:
        number = 2 << 24 | self.mode << 22 | self.faults << 16 | self.node << 8 | _HOST
        if not data:
            angle = self.angle - self.zero
            if self.wraps:
                angle = (angle + self.angle_max) % (2.0 * self.angle_max) - self.angle_max
            fields = (
                min(max(int((value + most) / (2.0 * most) * 65535), 0), 65535)
                for value, most in (
                    (angle, self.angle_max),
                    (self.rate, self.rate_max),
                    (self.bridge.value, self.torque_max),
                )
            )
            data = struct.pack(">HHHH", *fields, 305)
        return CanFrame(number, data, extended=True)

    def tick(self, now: float) -> Sequence[CanFrame]:
        timeout = 5e-5 * self.parameters.get(0x7028, 0)
        if self.mode == 2 and self.watches and timeout and now - self.fed > timeout:
            self.mode = 0
            self.torque *= self.keeps
        if self.mode == 2 and self.parameters[0x701C] > 60.0:
            self.fail(0, 1 << 3)
        said, self._said = self._said, []
        return said
