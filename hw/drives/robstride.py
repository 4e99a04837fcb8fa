"""RobStride's drives in their operation mode: classic frames of 29-bit identifiers, answered by angle, rate and mode.

    identifier  kind << 24 | 16 bits of data << 8 | who it is for; a drive's own has its number in bits 8 to 15
    told        kind 1: torque in the identifier; angle, rate and both gains, 0, in the data: 16 bits each
    enabled, stopped    kinds 3 and 4; the latter clears faults where its first byte is 1
    parameters  read and written by number, kinds 17 and 18, the latter not saved: watchdog, mode, torque, supply
    answers     kind 2, to all but reading: faults and mode in the identifier

What a frame's fields stand for differs with the model, which no drive says: the bench file does. Facts are from its
maker's manuals (April 2026); no such drive was there. A drive that its watchdog stops is in its mode of reset, without
a fault. One that is found so, and was not told to stop, is taken for stopped by its watchdog; one that was switched off
and on looks alike. The question for angle and state is to write the watchdog's time, so that such a one has it again.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence

from hw.drives.bench_file import DriveEntry
from hw.drives.drive import ASKS, CanDrive, CanFrame, DriveFacts, DriveReading, DriveState, Talk
from hw.drives.mit import STEPS_16, count_of, value_of
from met.diagnostic import did_you_mean

IDENTITY, TELL, FEEDBACK, ENABLE, STOP, READ, WRITE, FAULT = 0, 1, 2, 3, 4, 17, 18, 21
"""Kinds of frames."""

HOST, EVERYONE = 0xFD, 0xFE
"""The host's number; and that under which a drive says its identity."""

RUN_MODE, TORQUE_LIMIT, ANGLE, SUPPLY, TIMEOUT = 0x7005, 0x700B, 0x7019, 0x701C, 0x7028
"""Numbers of parameters."""

LAYOUTS: Mapping[int, str] = {RUN_MODE: "<B", TORQUE_LIMIT: "<f", ANGLE: "<f", SUPPLY: "<f", TIMEOUT: "<I"}
OPERATION_MODE = 0
TIMEOUT_UNIT = 50e-6
"""s of a count of the watchdog's parameter. That it is so each arming proves."""

VERSION = bytes((0x00, 0xC4))
"""Data of a frame that stops and asks for the firmware's version; the answer begins with it and a third byte, 0x56."""

MODELS: Mapping[str, tuple[float, float]] = {
    "RS00": (33.0, 14.0),
    "RS01": (44.0, 17.0),
    "RS02": (44.0, 17.0),
    "RS03": (20.0, 60.0),
    "RS04": (15.0, 120.0),
    "RS05": (50.0, 5.5),
    "RS06": (50.0, 36.0),
    "EL05": (50.0, 6.0),
}
"""rad/s and N m at which the fields of rate and torque end, by model."""

ANGLE_MAX = 4.0 * math.pi
"""rad at which the field of the angle ends, of every model. Beyond it an angle begins anew."""

RESET, CALIBRATING, RUNNING = 0, 1, 2
FEEDBACK_FAULTS = {
    1: "supply under voltage",
    1 << 1: "over current",
    1 << 2: "too hot",
    1 << 3: "encoder",
    1 << 4: "overload",
    1 << 5: "not calibrated",
}
FAULTS = {
    1: "motor too hot",
    1 << 1: "driver chip",
    1 << 2: "supply under voltage",
    1 << 3: "supply over voltage",
    1 << 4: "current of phase B",
    1 << 5: "current of phase C",
    1 << 7: "encoder not calibrated",
    1 << 8: "hardware",
    1 << 9: "where it stands",
    1 << 14: "overload",
    1 << 16: "current of phase A",
}
"""Bits of faults: of each answer, and of a frame of their own."""

STARVED = "it heard nothing for too long, or has begun anew"

RATE_SHARE = 0.9
"""Share of the largest rate that its frames can tell, above which nothing is to go."""

ANSWERS_HZ = 1000.0
"""Rate at which two such drives answer on a bus of 1 Mbit/s."""

ANGLE_TOLERANCE, TIME_TOLERANCE = 0.02, 0.02
"""Largest difference of the angle in a frame from the parameter read before, rad, at rest; and the time of its rate,
s."""

STAYS = 10
"""Smallest reported turn, in steps of the angle, that counts where it may stand at the end of its range."""


class RobstrideDrive(CanDrive):
    """The host's side of a RobStride drive."""

    dialect = "robstride"

    def __init__(self, entry: DriveEntry) -> None:
        super().__init__(entry)
        self._identity: bytes | None = None
        self._version: bytes | None = None
        self._answered: dict[int, bytes] = {}
        self._rate_max = self._torque_max = 1.0
        self._timeout = round(entry.figures["watchdog"] / TIMEOUT_UNIT)
        self._wanted = self._ran = False
        """True where it was told to run, and where it was seen to since; False once it was told to stop."""
        self._faults = 0
        self._last = -1, 0.0
        """Angle of its last answer, in counts, and its time, s."""

    def greet(self, talk: Talk) -> DriveFacts:
        """Read the identity, firmware and limits of this drive, and set its mode and watchdog; it is idle afterwards.
        Raises Problem E402 to E404."""
        self._identity, self._faults = None, 0
        if not 0 < self.node <= 127:
            raise self.wrong("its number is none of a RobStride", "a number from 1 to 127")
        self._rate_max, self._torque_max = self._ranges()
        self.steps = 2.0 * ANGLE_MAX / STEPS_16, 2.0 * self._rate_max / STEPS_16
        if not talk.ask([self._frame(IDENTITY)], lambda: self._identity is not None):
            raise talk.silent(self, "what its identity is")
        assert self._identity is not None
        self._wanted = self._ran = False
        talk.send([self._frame(STOP)])
        firmware = self._firmware(talk)
        self._set(talk, TIMEOUT, self._timeout)
        self._set(talk, RUN_MODE, OPERATION_MODE)
        torque, watchdog = self._read(talk, TORQUE_LIMIT), self._read(talk, TIMEOUT) * TIMEOUT_UNIT
        if not 0.0 < torque <= 1.001 * self._torque_max:
            helps = f"`model` of `[{self.entry.role}]` is another, or its parameter 0x{TORQUE_LIMIT:X} was changed"
            most = f"and an {self.entry.model} has {self._torque_max:g} N*m at most"
            raise self.wrong(f"its limit of torque is {torque:.4g} N*m, {most}", helps)
        self.supply = self._read(talk, SUPPLY)
        self._check_angle(talk)
        return DriveFacts(
            firmware,
            f"{self.entry.model} {self._identity.hex()}",
            watchdog,
            min(torque, self._torque_max),
            RATE_SHARE * self._rate_max,
            ANSWERS_HZ,
            torque_count=2.0 * self._torque_max / STEPS_16,
            angle_count=self.steps[0],
            rate_count=self.steps[1],
            angle_range=2.0 * ANGLE_MAX,
        )

    def _ranges(self) -> tuple[float, float]:
        """The ranges of its fields of rate (rad/s) and torque (N m). Raises Problem E404."""
        model = self.entry.model
        if model not in MODELS:
            why = f"there is no model `{model}`" if model else "the bench file does not say which model it is"
            helps = (*did_you_mean(model, MODELS), f'`model = "RS02"` in `[{self.entry.role}]`: {", ".join(MODELS)}')
            raise self.wrong(f"{why}, by which its frames mean other numbers", helps)
        return MODELS[model]

    def _firmware(self, talk: Talk) -> str:
        """The version of its firmware, from two answers that are the same. Raises Problem E403."""
        before, self.reading = None, None
        for _ in range(ASKS):
            self._version = None
            if not talk.ask([self._frame(STOP, VERSION)], lambda: self._version is not None):
                if self.reading is None:
                    raise talk.silent(self, "what its firmware is")
                break
            if self._version == before:
                return ".".join(str(number) for number in self._version or b"")
            before = self._version
        raise self.other("it does not say its firmware's version", "put its maker's newest firmware on it")

    def _check_angle(self, talk: Talk) -> None:
        """Raise Problem E403 where an angle in a frame differs from the parameter."""
        off = most = math.inf
        for _ in range(ASKS):
            angle, self.reading = self.own(self._read(talk, ANGLE)), None
            if not talk.ask(self.query(), lambda: self.reading is not None):
                raise talk.silent(self, "what its angle is")
            assert self.reading is not None
            off = abs(math.remainder(self.reading.angle - angle, 2.0 * ANGLE_MAX))
            most = ANGLE_TOLERANCE + TIME_TOLERANCE * abs(self.reading.rate)
            if off <= most:
                return
        helps = ("older firmware has another range of the angle: put its maker's newest on it", "two of one number?")
        raise self.other(f"its angle in a frame is {off:.3g} rad off what its parameter says", helps)

    def _read(self, talk: Talk, number: int) -> float:
        """A parameter, read until two successive answers are equal, unless it changes: a limit is not taken from one
        frame."""
        before = b""
        for _ in range(ASKS):
            self._answered.pop(number, None)
            if not talk.ask([self._asks(number)], lambda: number in self._answered):
                raise talk.silent(self, f"what its parameter 0x{number:X} is")
            data = self._answered[number]
            if not data:
                raise self.wrong(f"it has no parameter 0x{number:X}", "put its maker's newest firmware on it")
            if data == before or number in (ANGLE, SUPPLY):
                value = float(struct.unpack_from(LAYOUTS[number], data)[0])
                if math.isfinite(value):
                    return value
            before = data
        helps = "two drives of one number?"
        raise self.wrong(f"it answers each time differently what its parameter 0x{number:X} is", helps)

    def _set(self, talk: Talk, number: int, value: int) -> None:
        """Set a parameter, and see that it is set. Raises Problem E404 where it is not."""
        for _ in range(ASKS):
            talk.send([self._writes(number, value)])
            if (value_read := self._read(talk, number)) == value:
                return
        helps = "put its maker's newest firmware on it"
        raise self.wrong(f"it does not take {value} for its parameter 0x{number:X}, which is {value_read:g}", helps)

    # Frames

    def _frame(self, kind: int, data: bytes = b"", middle: int = HOST) -> CanFrame:
        return CanFrame(kind << 24 | middle << 8 | self.node, data.ljust(8, b"\0"), extended=True)

    def _asks(self, number: int) -> CanFrame:
        return self._frame(READ, struct.pack("<H", number))

    def _writes(self, number: int, value: int) -> CanFrame:
        return self._frame(WRITE, struct.pack("<HH", number, 0) + struct.pack(LAYOUTS[number], value))

    def armed(self) -> Sequence[CanFrame]:
        """Send no torque before it is enabled, nor after: no manual says whether a drive that is off takes one."""
        self._wanted, self._ran = True, False
        settings = self._writes(TIMEOUT, self._timeout), self._writes(RUN_MODE, OPERATION_MODE)
        return (*settings, *self.command(0.0), self._frame(ENABLE), *self.command(0.0))

    def command(self, value: float) -> Sequence[CanFrame]:
        torque = count_of(self.own(value), self._torque_max, STEPS_16)
        nothing = struct.pack(">HHHH", STEPS_16 // 2, STEPS_16 // 2, 0, 0)
        return (self._frame(TELL, nothing, torque),)

    def query(self) -> Sequence[CanFrame]:
        return (self._writes(TIMEOUT, self._timeout), self._asks(SUPPLY))

    def is_asked_by(self, frame: CanFrame) -> bool:
        return frame.extended and frame.id & 0xFF == self.node and frame.id >> 24 in (TELL, ENABLE, STOP, WRITE)

    def is_command(self, frame: CanFrame) -> bool:
        for_this = frame.extended and not frame.fd and not frame.remote and frame.id & 0xFF == self.node
        return for_this and frame.id >> 24 not in (IDENTITY, FEEDBACK, READ, FAULT)

    def idle(self) -> Sequence[CanFrame]:
        """Send no torque while the drive still takes it, so that none is left when it is enabled."""
        self._wanted = self._ran = False
        return (*self.command(0.0), self._frame(STOP))

    def cleared(self) -> Sequence[CanFrame]:
        self._wanted, self._ran, self._faults = False, False, 0
        return (self._frame(STOP, b"\1"),)

    def answers(self) -> Sequence[CanFrame]:
        return (CanFrame(FEEDBACK << 24 | self.node << 8 | HOST, bytes(8), extended=True),)

    def take(self, frame: CanFrame) -> bool:
        """Take an answer of this drive: identity, parameter, fault, or angle, rate and mode. Returns whether the frame
        is one and new."""
        data = frame.data
        if not frame.extended or frame.fd or frame.remote or len(data) != 8 or frame.id >> 8 & 0xFF != self.node:
            return False
        kind, above, to = frame.id >> 24, frame.id >> 16 & 0xFF, frame.id & 0xFF
        if kind == IDENTITY and to == EVERYONE and not above:
            self._identity = data
            return True
        if to != HOST:
            return False
        if kind == READ and above <= 1:
            number = struct.unpack_from("<H", data)[0]
            self._answered[number] = b"" if above else data[4:]
            if number == SUPPLY and not above and math.isfinite(volts := struct.unpack_from("<f", data, 4)[0]):
                self.supply = volts
        elif kind == FAULT and not above:
            self._faults |= struct.unpack_from("<I", data)[0]
        elif kind == FEEDBACK and above >> 6 <= RUNNING:
            version = data.startswith(VERSION + b"\x56") and above >> 6 != RUNNING and self._version is None
            at_end = data[:2] in (b"\0\0", b"\xff\xff")  # where the angle of older firmware stays
            angle, rate_count = struct.unpack_from(">HH", data)
            rate = value_of(rate_count, self._rate_max, STEPS_16)
            if not (version or at_end) and self.has_said(data[:4], rate, frame.time):
                return False
            self._state(above >> 6, above & 0x3F, frame.time)
            if version:
                self._version = data[3:7]
                return True
            self._read_shaft(angle, rate, frame.time)
        else:
            return False
        return True

    def _read_shaft(self, angle: int, rate: float, time: float) -> None:
        """Take the angle, in counts, and the rate, rad/s in the drive's own sense. One that turns and whose angle stays
        at an end of its range has failed: the angle of older firmware does not begin anew there."""
        at_end, before = angle in (0, STEPS_16), self._last
        self._last = angle, time
        if at_end and before[0] == angle and abs(rate) * (time - before[1]) > STAYS * 2.0 * ANGLE_MAX / STEPS_16:
            self.errors, self.starved = "its angle stays at the end of its range", False
            self.state = self.state if self.state == DriveState.DRIVING else DriveState.FAILED
        self.reading = DriveReading(time, self.own(value_of(angle, ANGLE_MAX, STEPS_16)), self.own(rate))

    def _state(self, mode: int, faults: int, time: float) -> None:
        """Take the mode and the faults of an answer as the drive's state. time: of the frame, s"""
        self.stated = time
        faults_named = [words for bit, words in FAULTS.items() if self._faults & bit]
        faults_named += [words for bit, words in FEEDBACK_FAULTS.items() if faults & bit and words not in faults_named]
        if self._faults & ~sum(FAULTS):
            faults_named.append(f"fault 0x{self._faults:X}")
        self.starved = not faults_named and self._ran and mode != RUNNING
        self.errors = STARVED if self.starved else ", ".join(faults_named)
        if mode == RUNNING:  # whatever its faults
            self.state, self._ran = DriveState.DRIVING, self._wanted
        else:
            self.state = DriveState.FAILED if self.errors else DriveState.IDLE
