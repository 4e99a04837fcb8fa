"""moteus, by its registers over CAN-FD: each frame writes some and asks for others, and is answered with those.

    told      position mode with gains of 0 and a torque, its largest torque, and the time that the command is valid for
    answered  mode, position, velocity, fault, voltage and power of the supply
    modes     0 stopped, 1 fault, 10 position, 11 the command's time is over, 15 windings shorted

Its watchdog is that of the position mode: voltage and current modes have none. Facts are from mjbots' reference of the
registers; no moteus was there.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from hw.drives.bench_file import DriveEntry
from hw.drives.drive import SIZES, CanDrive, CanFrame, DriveFacts, DriveReading, DriveState, Talk

ASKS_ANSWER = 0x8000
INT8, INT32, FLOAT = 0, 2, 3
"""Kinds of values, as they stand in subframes; their struct formats are in `FORMATS`."""

FORMATS = ("b", "h", "i", "f")
WRITE, READ, ANSWER = 0x00, 0x10, 0x20
WRITE_ERROR, READ_ERROR, NOTHING = 0x30, 0x31, 0x50

MODE, POSITION, VELOCITY, POWER, VOLTAGE, FAULT = 0x000, 0x001, 0x002, 0x007, 0x00D, 0x00F
TARGET, TORQUE, VALID_FOR, INTEGRAL_SCALE, MODEL = 0x020, 0x022, 0x027, 0x02B, 0x100

STOPPED, FAILED, DRIVING, TIMED_OUT, BRAKING = 0, 1, 10, 11, 15
BEGINNING = (2, 3, 4)
FAULTS = {
    32: "calibration",
    33: "gate driver",
    34: "supply over voltage",
    35: "encoder",
    36: "motor not configured",
    37: "its cycle took too long",
    38: "too hot",
    39: "outside of its position limits",
    40: "supply under voltage",
    41: "configuration changed",
    42: "no commutation encoder",
    43: "no output encoder",
    44: "gate driver not enabled",
    46: "timing",
}

REGISTER_MAP = 5
"""Version of the register map that the registers here are of."""

CONTROL_HZ = 15000.0
"""Least rate of the drive's own control, Hz."""


def number(value: int) -> bytes:
    """A register's number as it goes over the bus: seven bits a byte, the lowest first."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes(out) + bytes([value])


def written(kind: int, first: int, *values: float) -> bytes:
    """The subframe that writes values to registers from `first` on."""
    count = bytes([WRITE | kind << 2 | len(values)]) if len(values) < 4 else bytes([WRITE | kind << 2, len(values)])
    return count + number(first) + struct.pack(f"<{len(values)}{FORMATS[kind]}", *values)


def asked_for(kind: int, first: int, count: int = 1) -> bytes:
    """The subframe that asks for up to three registers from `first` on."""
    return bytes([READ | kind << 2 | count]) + number(first)


def writes(data: bytes) -> bool:
    """True for the data of a frame that does more than to ask for registers."""
    position = 0
    try:
        while position < len(data):
            head, position = data[position], position + 1
            if head == NOTHING:
                continue
            if head & 0xF0 != READ:
                return True
            if not head & 3:
                _, position = _number(data, position)
            _, position = _number(data, position)
    except IndexError:
        return False
    return False


def padded(data: bytes) -> bytes:
    """The data of a frame, filled up to a length that there is."""
    return data.ljust(next(size for size in SIZES if size >= len(data)), bytes([NOTHING]))


def answered(data: bytes) -> dict[int, float] | None:
    """The registers that an answer tells, by number; None where it is no answer that can be read to its end."""
    registers: dict[int, float] = {}
    position = 0
    try:
        while position < len(data):
            head, position = data[position], position + 1
            if head == NOTHING:
                continue
            if head in (WRITE_ERROR, READ_ERROR):
                _, position = _number(data, position)
                _, position = _number(data, position)
                continue
            if head & 0xF0 != ANSWER:
                return None
            kind, count = head >> 2 & 3, head & 3
            if not count:
                count, position = _number(data, position)
            first, position = _number(data, position)
            layout = struct.Struct(f"<{count}{FORMATS[kind]}")
            registers |= dict(enumerate(layout.unpack_from(data, position), first))
            position += layout.size
    except (IndexError, struct.error):
        return None
    return registers


def _number(data: bytes, position: int) -> tuple[int, int]:
    """A number of variable length at a position of the data, and the position behind it."""
    value = shift = 0
    while True:
        byte, position = data[position], position + 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80 or shift > 28:
            return value, position


_STATE = asked_for(FLOAT, MODE, 3) + asked_for(FLOAT, POWER) + asked_for(FLOAT, VOLTAGE) + asked_for(INT8, FAULT)


class MoteusDrive(CanDrive):
    """The host's side of a moteus."""

    dialect = "moteus"

    def __init__(self, entry: DriveEntry) -> None:
        super().__init__(entry)
        self._about: dict[int, float] = {}
        self._watchdog = entry.figures["watchdog"]

    def greet(self, talk: Talk) -> DriveFacts:
        """Check the model and register map of this moteus, and stop it. Raises Problem E402 to E404."""
        self._about = {}
        if not self.node > 0:
            raise self.wrong("its number is everybody's", "a number from 1 to 127")
        if not talk.ask([self._frame(asked_for(INT32, MODEL, 3))], lambda: len(self._about) == 3):
            raise talk.silent(self, "what model it is")
        model, version, registers = (int(self._about[MODEL + n]) for n in range(3))
        if registers != REGISTER_MAP:
            helps = f"firmware whose map is of version {REGISTER_MAP}"
            raise self.other(f"its register map is of version {registers}", helps)
        self.reading = None
        talk.send(self.idle())
        if not talk.ask(self.query(), lambda: self.reading is not None and self.state != DriveState.DRIVING):
            raise talk.silent(self, "what its angle is")
        firmware = ".".join(str(version >> shift & 0xFF) for shift in (16, 8, 0))
        braking = self.entry.role == "drive"
        return DriveFacts(
            firmware, f"model 0x{model:X}", self._watchdog, math.inf, math.inf, CONTROL_HZ, braking=braking
        )

    def _frame(self, data: bytes) -> CanFrame:
        return CanFrame(ASKS_ANSWER | self.node, padded(data), extended=True, fd=True)

    def armed(self) -> Sequence[CanFrame]:
        return (self._frame(written(INT8, MODE, STOPPED)), *self.command(0.0))

    def command(self, value: float) -> Sequence[CanFrame]:
        """The frame that commands a torque, N m, for the time of the watchdog, and asks for the state."""
        torque = (self.own(value), 0.0, 0.0, self.bears)  # and no part of its gains
        data = written(INT8, MODE, DRIVING) + written(FLOAT, TARGET, math.nan) + written(FLOAT, TORQUE, *torque)
        data += written(FLOAT, VALID_FOR, self._watchdog) + written(FLOAT, INTEGRAL_SCALE, 0.0)
        return (self._frame(data + _STATE),)

    def query(self) -> Sequence[CanFrame]:
        return (self._frame(_STATE),)

    def is_asked_by(self, frame: CanFrame) -> bool:
        return frame.id == ASKS_ANSWER | self.node and _STATE in frame.data

    def is_command(self, frame: CanFrame) -> bool:
        return frame.extended and frame.id & 0x7F == self.node and not frame.id >> 16 and writes(frame.data)

    def idle(self) -> Sequence[CanFrame]:
        """The drive under test brakes, the load lets go. What has failed is off, and stopping it would forget why."""
        if self.state == DriveState.FAILED:
            return ()
        return (self._frame(written(INT8, MODE, BRAKING if self.entry.role == "drive" else STOPPED) + _STATE),)

    def cleared(self) -> Sequence[CanFrame]:
        return (self._frame(written(INT8, MODE, STOPPED)),)

    def answers(self) -> Sequence[CanFrame]:
        return (CanFrame(self.node << 8, bytes(32), extended=False, fd=True),)

    def take(self, frame: CanFrame) -> bool:
        """Take registers that this moteus answers: its model, or mode, angle, rate and supply. Returns whether the
        frame has them and is new."""
        if frame.id != self.node << 8 or not frame.fd or frame.remote:
            return False
        registers = answered(frame.data)
        if not registers:
            return False
        if all(MODEL + n in registers for n in range(3)):
            self._about = {MODEL + n: registers[MODEL + n] for n in range(3)}
            return True
        values = [registers.get(register, math.nan) for register in (MODE, POSITION, VELOCITY, VOLTAGE, FAULT)]
        if not all(math.isfinite(value) for value in values):
            return False
        mode, position, velocity, supply, fault = values
        if self.has_said((position, velocity), math.tau * velocity, frame.time):
            return False
        self.supply = supply
        power = registers.get(POWER, math.nan)
        self.power = power if math.isfinite(power) else None
        self._state(int(mode), int(fault), frame.time)
        self.reading = DriveReading(frame.time, self.own(math.tau * position), self.own(math.tau * velocity))
        return True

    def _state(self, mode: int, fault: int, time: float) -> None:
        """Take the mode and the fault of an answer as the drive's state. time: of the frame, s"""
        self.stated, self.errors, self.starved = time, "", mode == TIMED_OUT
        if mode in (STOPPED, BRAKING, *BEGINNING):
            self.state = DriveState.IDLE
        elif mode == DRIVING:
            self.state = DriveState.DRIVING
        else:
            self.state = DriveState.FAILED
            self.errors = FAULTS.get(fault, f"fault {fault}") if mode == FAILED else f"mode {mode}"
            if self.starved:
                self.errors = "heard nothing for too long"
