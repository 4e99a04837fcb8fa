"""A Damiao drive in its MIT mode."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from hw.drives.drive import CanFrame
from tests.hw.players.player import PlayedDrive
from tests.hw.players.shaft import OFF, Output


class PlayedDamiao(PlayedDrive):
    """A Damiao drive.

    answers_as  identifier of its answers
    watches     False for one whose watchdog does nothing
    wraps       False for one whose angle stays at the end of its range
    keeps       True for one that goes on with the torque that it was told last once it is enabled
    takes_off   False for one that takes no torque while it is off
    registers   by number: whole numbers and floats, as they are
    """

    def __init__(
        self, node: int, sense: int = 1, *, angle_max: float = 12.5, rate_max: float = 280.0, torque_max: float = 1.0
    ) -> None:
        super().__init__(node, sense)
        self.answers_as = 0x10 + node
        self.watches = self.wraps = self.takes_off = True
        self.keeps = False
        self.registers: dict[int, int | float] = {7: self.answers_as, 8: node, 9: 0, 10: 2, 13: 1, 14: 5015, 36: 2}
        self.registers |= {21: angle_max, 22: rate_max, 23: torque_max, 29: 32.0}
        self.refuses: set[int] = set()
        self.state, self.torque, self.fed = 0, 0.0, 0.0

    def reboot(self) -> None:
        """Restart as after a loss of supply: unsaved values are gone."""
        self.state, self.torque = 0, 0.0

    def fail(self, state: int) -> None:
        self.state = state
        self.torque *= self.keeps

    @property
    def bridge(self) -> Output:
        return Output("torque", self.torque) if self.state == 1 else OFF

    def receive(self, frame: CanFrame, now: float) -> Sequence[CanFrame]:
        data = frame.data
        if frame.extended or frame.fd or frame.remote or len(data) != 8:
            return ()
        if frame.id == 0x7FF and data[0] | data[1] << 8 == self.node:
            self.fed = now
            return self._register(data)
        if frame.id != self.node:
            return ()
        self.fed = now
        if data[:7] == b"\xff" * 7 and data[7] in (0xFB, 0xFC, 0xFD):
            if data[7] == 0xFB and self.state > 1:
                self.state = 0
            elif data[7] == 0xFC and self.state == 0:
                self.state = 1
            elif data[7] == 0xFD and self.state == 1:
                self.state = 0
                self.torque *= self.keeps
        elif self.registers[10] == 1 and not (self.takes_off or self.state == 1):
            return (self._feedback(),)
        elif self.registers[10] == 1:
            most = float(self.registers[23])
            gains = (data[3] & 15) << 8 | data[4], data[5] << 4 | data[6] >> 4
            count = (data[6] & 15) << 8 | data[7]
            self.torque = count / 4095 * 2.0 * most - most if gains == (0, 0) else 0.0
        else:
            return ()
        return (self._feedback(),)

    def _feedback(self) -> CanFrame:
        angle_max, rate_max, torque_max = (float(self.registers[each]) for each in (21, 22, 23))
        angle = self.angle
        if self.wraps:
            angle = (angle + angle_max) % (2.0 * angle_max) - angle_max
        p, v, t = (
            min(max(int((value + most) / (2.0 * most) * steps), 0), steps)
            for value, most, steps in (
                (angle, angle_max, 65535),
                (self.rate, rate_max, 4095),
                (self.bridge.value, torque_max, 4095),
            )
        )
        return CanFrame(
            self.answers_as,
            bytes((self.state << 4 | self.node, p >> 8, p & 255, v >> 4, (v & 15) << 4 | t >> 8, t & 255, 30, 31)),
        )

    def _register(self, data: bytes) -> Sequence[CanFrame]:
        code, register = data[2], data[3]
        if code == 0xCC:
            return (self._feedback(),)
        if register not in self.registers or code not in (0x33, 0x55):
            return ()
        whole = isinstance(self.registers[register], int)
        if code == 0x55 and register not in self.refuses:
            self.registers[register] = struct.unpack("<I" if whole else "<f", data[4:])[0]
        value = struct.pack("<I" if whole else "<f", self.registers[register])
        return (CanFrame(self.answers_as, data[:4] + value),)

    def tick(self, now: float) -> Sequence[CanFrame]:
        timeout = 5e-5 * float(self.registers[9])
        if self.state == 1 and self.watches and timeout and now - self.fed > timeout:
            self.fail(0xD)
        return ()
