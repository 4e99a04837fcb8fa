"""Damiao's drives in their MIT mode: classic frames of 8 bytes, each answered by angle, rate, torque and state.

    told        the MIT frame under the drive's own number, with both gains 0: torque alone
    enabled, disabled, cleared    seven bytes of FF and FC, FD, FB, under the same number
    registers   under 0x7FF, by number: what the ends of the fields stand for, the watchdog, the mode
    answers     under the number that register 7 says, whatever it is: the drive is known by what is inside

Facts are from a public description of the protocol and its registers (firmware whose version ends with 15); no such
drive was there. What a register is set to here is not saved. An angle is taken to begin anew beyond its range.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from hw.drives.bench_file import DriveEntry
from hw.drives.drive import ASKS, CanDrive, CanFrame, DriveFacts, DriveReading, DriveState, Talk
from hw.drives.mit import STEPS_12, STEPS_16, count_of, packed, value_of

REGISTERS = 0x7FF
READ, WRITE, REFRESH = 0x33, 0x55, 0xCC
ENABLE, DISABLE, CLEAR = (bytes(7 * [0xFF]) + bytes([last_byte]) for last_byte in (0xFC, 0xFD, 0xFB))
TIMEOUT, MODE, VERSION, PMAX, VMAX, TMAX, OVER_VOLTAGE, SUB_VERSION = 9, 10, 14, 21, 22, 23, 29, 36
"""Numbers of registers."""

WHOLE = (TIMEOUT, MODE, VERSION, SUB_VERSION)
"""Registers that hold whole numbers; the others hold floats."""

MIT_MODE = 1
MODES = range(4)
"""Modes under which it is told something, MIT's first: 256 times the mode is added to its number."""
TIMEOUT_UNIT = 50e-6
"""s of a count of the watchdog's register. That it is so each arming proves."""

MOST_NODE = 15
"""Largest number of a drive: its answers have four bits for it."""

ENABLED, LOST = 1, 0xD
STATES = {
    8: "supply over voltage",
    9: "supply under voltage",
    0xA: "over current",
    0xB: "transistors too hot",
    0xC: "rotor too hot",
    LOST: "heard nothing for too long",
    0xE: "overload",
}

RATE_SHARE = 0.9
"""Share of the largest rate that its frames can tell, above which nothing is to go."""

ANSWERS_HZ = 1000.0
"""Rate at which two such drives answer on a bus of 1 Mbit/s."""


class DamiaoDrive(CanDrive):
    """The host's side of a Damiao drive."""

    dialect = "damiao"

    def __init__(self, entry: DriveEntry) -> None:
        super().__init__(entry)
        self._answers_as = -1
        self._wanted = -1
        self._came: bytes | None = None
        self._angle_max = self._rate_max = self._torque_max = 1.0

    def greet(self, talk: Talk) -> DriveFacts:
        """Read the ranges of this drive's fields, and set its MIT mode and watchdog; it is idle afterwards. Raises
        Problem E402, E404."""
        self._answers_as = -1
        if not 0 < self.node <= MOST_NODE:
            raise self.wrong("its number is none that its answers have room for", f"a number from 1 to {MOST_NODE}")
        version, sub = int(self._read(talk, VERSION)), int(self._read(talk, SUB_VERSION))
        talk.send([self._frame(DISABLE)])
        self._write(talk, MODE, MIT_MODE)
        self._write(talk, TIMEOUT, round(self.entry.figures["watchdog"] / TIMEOUT_UNIT))
        ends = [self._read(talk, register) for register in (PMAX, VMAX, TMAX)]
        supply = self._read(talk, OVER_VOLTAGE)
        if not all(math.isfinite(figure) and figure > 0.0 for figure in (*ends, supply)):
            raise self.wrong(
                "what its fields or its overvoltage stand for is no number above zero", "set registers 21 to 29"
            )
        self._angle_max, self._rate_max, self._torque_max = ends
        self.steps = 2.0 * self._angle_max / STEPS_16, 2.0 * self._rate_max / STEPS_12
        watchdog = self._read(talk, TIMEOUT) * TIMEOUT_UNIT
        self.reading = None
        if not talk.ask(self.query(), lambda: self.reading is not None):
            raise talk.silent(self, "what its angle is")
        return DriveFacts(
            f"{version}.{sub}",
            f"{self._angle_max:g} rad, {self._rate_max:g} rad/s, {self._torque_max:g} N*m",
            watchdog,
            self._torque_max,
            RATE_SHARE * self._rate_max,
            ANSWERS_HZ,
            torque_count=2.0 * self._torque_max / STEPS_12,
            angle_count=self.steps[0],
            rate_count=self.steps[1],
            angle_range=2.0 * self._angle_max,
            supply_max=supply,
        )

    def _register(self, talk: Talk, register: int, code: int, data: bytes) -> bytes:
        """Read or write a register; returns its four bytes. Raises Problem E402 where the drive does not answer."""
        self._wanted, self._came = register, None
        frame = CanFrame(REGISTERS, struct.pack("<HBB", self.node, code, register) + data)
        if not talk.ask([frame], lambda: self._came is not None):
            raise talk.silent(self, f"what its register {register} is")
        self._wanted = -1
        assert self._came is not None
        return self._came

    def _read(self, talk: Talk, register: int) -> float:
        """A register, read until two answers in a row are the same: a limit is not taken from one frame."""
        before = b""
        for _ in range(ASKS):
            data = self._register(talk, register, READ, bytes(4))
            if data == before:
                return float(struct.unpack("<I" if register in WHOLE else "<f", data)[0])
            before = data
        raise self.wrong(f"it answers each time differently what register {register} is", "two drives of one number?")

    def _write(self, talk: Talk, register: int, value: int) -> None:
        """Set a register of a whole number, and see that it is set. Raises Problem E404 where it is not."""
        for _ in range(ASKS):
            self._register(talk, register, WRITE, struct.pack("<I", value))
            if (value_read := self._read(talk, register)) == value:
                return
        raise self.wrong(
            f"it does not take {value} for register {register}, which is {value_read:g}", "its maker's tool does?"
        )

    # Frames

    def _frame(self, data: bytes) -> CanFrame:
        return CanFrame(self.node, data)

    def armed(self) -> Sequence[CanFrame]:
        """Send no torque before it is enabled, nor after: no document says whether a drive that is off takes one."""
        return (*self.command(0.0), self._frame(ENABLE), *self.command(0.0))

    def command(self, value: float) -> Sequence[CanFrame]:
        torque = count_of(self.own(value), self._torque_max, STEPS_12)
        return (self._frame(packed(STEPS_16 // 2, STEPS_12 // 2, 0, 0, torque)),)

    def query(self) -> Sequence[CanFrame]:
        return (CanFrame(REGISTERS, struct.pack("<HBBI", self.node, REFRESH, 0, 0)),)

    def is_asked_by(self, frame: CanFrame) -> bool:
        refresh = frame.id == REGISTERS and frame.data[:3] == struct.pack("<HB", self.node, REFRESH)
        return refresh or frame.id == self.node

    def is_command(self, frame: CanFrame) -> bool:
        """True for a frame that writes a register of this drive, or commands it in any of its modes."""
        data = frame.data
        if frame.extended or frame.fd or frame.remote or frame.id == self._answers_as:
            return False
        if frame.id == REGISTERS:
            return data[:2] == struct.pack("<H", self.node) and data[2:3] not in (b"", bytes([READ]), bytes([REFRESH]))
        return frame.id & 0xFF == self.node and frame.id >> 8 in MODES and len(data) in (4, 8)

    def idle(self) -> Sequence[CanFrame]:
        """Send no torque while the drive still takes it, so that none is left when it is enabled."""
        return (*self.command(0.0), self._frame(DISABLE))

    def cleared(self) -> Sequence[CanFrame]:
        return (self._frame(CLEAR), self._frame(DISABLE))

    def answers(self) -> Sequence[CanFrame]:
        return (self._frame(bytes(8)),)

    def take(self, frame: CanFrame) -> bool:
        """Take an answer of this drive: a register's value, or angle, rate and state. Returns whether the frame is one
        and new."""
        data = frame.data
        if frame.extended or frame.fd or frame.remote or len(data) != 8 or frame.id in (self.node, REGISTERS):
            return False
        if (
            self._wanted >= 0
            and data[:2] == struct.pack("<H", self.node)
            and data[3] == self._wanted
            and data[2] in (READ, WRITE)
        ):
            self._came, self._answers_as = data[4:], frame.id
            return True
        if frame.id != self._answers_as or data[0] & 0xF != self.node:
            return False
        state = data[0] >> 4
        if state not in (0, ENABLED, *STATES):
            return False
        angle = value_of(data[1] << 8 | data[2], self._angle_max, STEPS_16)
        rate = value_of(data[3] << 4 | data[4] >> 4, self._rate_max, STEPS_12)
        at_end = data[1:3] in (b"\0\0", b"\xff\xff")  # where an angle that does not begin anew stays
        if not at_end and self.has_said((angle, rate), rate, frame.time):
            return False
        self._state(state, frame.time)
        self.reading = DriveReading(frame.time, self.own(angle), self.own(rate))
        return True

    def _state(self, state: int, time: float) -> None:
        self.stated, self.errors, self.starved = time, STATES.get(state, ""), state == LOST
        self.state = {0: DriveState.IDLE, ENABLED: DriveState.DRIVING}.get(state, DriveState.FAILED)
