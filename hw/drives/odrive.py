"""ODrive's CANSimple, of firmware 0.6: classic frames whose identifier is node << 5 | command, floats in turns.

    asked for           request without data, answered under the same identifier: version, estimates
    by itself           heartbeat with state and errors, every `HEARTBEAT`; voltage and current of the supply
    told                torque, N m of the motor's shaft, or its rate, turns/s; nothing answers it
    properties          read and written by number; a file of the firmware's maker, flat_endpoints.json, has them

Facts are from ODrive's documentation of the protocol and from what implements it; no ODrive was there. What CAN and
serial lines have in common is in hw/drives/odrive_axis.py.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from typing import Any

from hw.drives.bench_file import DriveEntry
from hw.drives.drive import ASKS, CanFrame, DriveFacts, DriveReading, DriveState, Talk
from hw.drives.odrive_axis import (
    CLOSED_LOOP,
    IDLE,
    NEEDED,
    NEEDED_FOR_RATES,
    PASSTHROUGH,
    TURN,
    OdriveAxis,
)
from met.host.files import read_regular

VERSION, HEARTBEAT_ID, ESTOP, READ_OR_WRITE, ANSWERED, SET_STATE = 0x00, 0x01, 0x02, 0x04, 0x05, 0x07
ESTIMATES, MODES, RATE, TORQUE, SUPPLY, CLEAR = 0x09, 0x0B, 0x0D, 0x0E, 0x17, 0x18
"""Commands, the lower five bits of an identifier."""

SAYS = (VERSION, HEARTBEAT_ID, 0x03, ANSWERED, ESTIMATES, 0x0A, 0x14, 0x15, SUPPLY, 0x1C, 0x1D)
"""Commands under which a drive says something; under all others it is told something."""

CHECK_EVERY, DOUBTED_EVERY = 8, 2
"""Exchanges of which one asks a drive what another master would have changed, and where that was seen once."""

HEARTBEAT_MS, SUPPLY_MS = 5, 20
"""Periods at which a drive is set to tell its state, and its supply's voltage and current, ms."""

MOST_NODE = 62
"""Largest number of a drive: an identifier has six bits for it, and 63 is one that has none."""

MOST_BYTES = 1 << 20
_TYPES = {"bool": "<?", "uint8": "<B", "int8": "<b", "uint16": "<H", "int16": "<h", "uint32": "<I", "int32": "<i"}
_TYPES |= {"float": "<f"}

HEARTBEAT_RATE = "axis0.config.can.heartbeat_msg_rate_ms"
ESTIMATES_RATE = "axis0.config.can.encoder_msg_rate_ms"
SUPPLY_RATE = "axis0.config.can.bus_voltage_msg_rate_ms"
REPORTS = (HEARTBEAT_RATE, ESTIMATES_RATE, SUPPLY_RATE)


def _endpoint(entry: Any) -> tuple[int, str]:
    """The number of a property, of 16 bits, and the format of its value. Raises ValueError, KeyError, TypeError."""
    number = entry["id"]
    if type(number) is not int or not 0 <= number < 1 << 16:
        raise ValueError
    return number, _TYPES[entry["type"]]


class OdriveDrive(OdriveAxis):
    """The host's side of an ODrive's axis."""

    dialect = "odrive"
    answers_commands = False

    def __init__(self, entry: DriveEntry) -> None:
        super().__init__(entry)
        self._version: bytes | None = None
        self._numbers: dict[str, tuple[int, str]] = {}
        """Properties' numbers and formats, by path."""
        self._answered: dict[int, bytes] = {}
        self._beats = self._turn = 0

    def greet(self, talk: Talk) -> DriveFacts:
        """Check the firmware of this ODrive, set its reports, and read its limits; it is idle afterwards. Raises
        Problem E402 to E404."""
        self._version, self._beats = None, 0
        self._written.clear()
        if self.node > MOST_NODE:
            raise self.wrong("its number is none of an ODrive", f"a number from 0 to {MOST_NODE}")
        if not talk.ask([self._request(VERSION)], lambda: self._version is not None):
            if self._beats:
                helps = ("firmware 0.5 and before does not: put 0.6 on it", "its maker's `odrivetool dfu` does so")
                raise self.other("it sends heartbeats, and does not say its version", helps)
            raise talk.silent(self, "Get_Version")
        assert self._version is not None
        _, *hardware = self._version[:4]
        firmware = tuple(self._version[4:7])
        words = ".".join(str(number) for number in firmware), ".".join(str(number) for number in hardware)
        self._check_firmware(firmware)
        talk.send(self.idle())
        self._numbers = self._endpoints(*words)
        for path, value in zip(REPORTS, (HEARTBEAT_MS, 0, SUPPLY_MS), strict=True):
            self._write(talk, path, value)
        facts = self._described(talk, *words)
        seen = self._beats
        if not talk.pump(talk.line.now() + 0.5, lambda: self._beats > seen + 1 and self.state != DriveState.DRIVING):
            raise talk.silent(self, "its heartbeat")
        return facts

    def _endpoints(self, firmware: str, hardware: str) -> dict[str, tuple[int, str]]:
        """The numbers of its properties, for the firmware that it has. Raises Problem E403, E404."""
        path = self.entry.endpoints
        helps = f"its maker has flat_endpoints.json for firmware {firmware} and hardware {hardware}"
        if not path:
            raise self.wrong("the bench file does not say where its properties are", (f"`endpoints`: {helps}"))
        try:
            data = json.loads(read_regular(path, MOST_BYTES))
            entries, named = data["endpoints"], (data["fw_version"], data["hw_version"])
            needed = (*REPORTS, *NEEDED, *NEEDED_FOR_RATES * self.rates)
            missing = [path for path in needed if path not in entries]
            numbers = {path: _endpoint(entries[path]) for path in needed if path in entries}
        except OSError as reason:
            raise self.wrong(f"{path} cannot be read: {(reason.strerror or str(reason)).lower()}", helps) from None
        except (ValueError, KeyError, TypeError, RecursionError):
            raise self.wrong(f"{path} is no file of its properties", helps) from None
        if missing:
            raise self.wrong(f"{path} has no `{missing[0]}`", helps)
        if named != (firmware, hardware):
            mismatch = f"{path} is for firmware {named[0]}, hardware {named[1]}"
            raise self.other(f"it has {firmware}, hardware {hardware}, and {mismatch}", helps)
        return numbers

    def _property(self, talk: Talk, number: int, payload: bytes) -> bytes:
        """Read or write a property; returns its bytes. Raises Problem E402 where the drive does not answer."""
        self._answered.pop(number, None)
        frame = self._frame(READ_OR_WRITE, payload)
        if not talk.ask([frame], lambda: number in self._answered):
            raise talk.silent(self, f"what its property {number} is")
        return self._answered[number]

    def _read(self, talk: Talk, path: str) -> float:
        """A property, read until two answers in a row are the same: a limit is not taken from one frame."""
        number, layout = self._numbers[path]
        before = b""
        for _ in range(ASKS):
            data = self._property(talk, number, struct.pack("<BHB", 0, number, 0))
            if data == before and len(data) >= struct.calcsize(layout):
                return float(struct.unpack_from(layout, data)[0])
            before = data
        raise self.wrong(f"it answers each time differently what `{path}` is", "two nodes of one number on the bus?")

    def _put(self, talk: Talk, path: str, value: float) -> None:
        number, layout = self._numbers[path]
        exact = value if layout == "<f" else int(value)
        talk.send([self._frame(READ_OR_WRITE, struct.pack("<BHB", 1, number, 0) + struct.pack(layout, exact))])

    # Frames

    def _request(self, command: int) -> CanFrame:
        return CanFrame(self.node << 5 | command, remote=True)

    def _frame(self, command: int, data: bytes = b"") -> CanFrame:
        return CanFrame(self.node << 5 | command, data)

    def armed(self) -> Sequence[CanFrame]:
        """Frames that set the mode, command 0, and close the loop."""
        return (
            self._frame(MODES, struct.pack("<II", self._mode, PASSTHROUGH)),
            *self.command(0.0),
            self._frame(SET_STATE, struct.pack("<I", CLOSED_LOOP)),
        )

    def command(self, value: float) -> Sequence[CanFrame]:
        """The frame that commands a torque, N m, or a rate, rad/s."""
        self._checks.tell(self.own(value) / TURN if self.rates else self.own(value))
        if self.rates:  # with no torque besides that of its loop
            return (self._frame(RATE, struct.pack("<ff", self.own(value) / TURN, 0.0)),)
        return (self._frame(TORQUE, struct.pack("<f", self.own(value))),)

    def query(self) -> Sequence[CanFrame]:
        return (self._request(ESTIMATES),)

    def is_asked_by(self, frame: CanFrame) -> bool:
        return frame.remote and frame.id == self.node << 5 | ESTIMATES

    def is_command(self, frame: CanFrame) -> bool:
        """True for a frame to this axis that is neither an answer nor only reads a property."""
        if frame.extended or frame.fd or frame.remote or frame.id >> 5 != self.node:
            return False
        command = frame.id & 0x1F
        return command not in SAYS and (command != READ_OR_WRITE or frame.data[:1] == b"\1")

    def checks(self) -> Sequence[CanFrame]:
        """A question for a property, at the end of the time for which the command before was in force; those to the two
        drives take turns."""
        self._turn += 1
        every = DOUBTED_EVERY if self._checks.doubtful else CHECK_EVERY
        if (self._turn + every // 2 * (self.entry.role == "load")) % every:
            return ()
        number, _ = self._numbers[self._checks.next()]
        return (self._frame(READ_OR_WRITE, struct.pack("<BHB", 0, number, 0)),)

    def idle(self) -> Sequence[CanFrame]:
        return (*self.command(0.0), self._frame(SET_STATE, struct.pack("<I", IDLE)))

    def halted(self) -> Sequence[CanFrame]:
        return (self._frame(ESTOP), *self.command(0.0))  # otherwise it would resume its command when armed again

    def cleared(self) -> Sequence[CanFrame]:
        return (self._frame(CLEAR, b"\0"), *self.idle())

    def answers(self) -> Sequence[CanFrame]:
        return (self._frame(ESTIMATES, bytes(8)),)

    def take(self, frame: CanFrame) -> bool:
        """Take a frame of this axis: estimates, heartbeat, version, supply or a property's value. Returns whether it is
        one and new."""
        if frame.extended or frame.fd or frame.remote or frame.id >> 5 != self.node:
            return False
        command, data = frame.id & 0x1F, frame.data
        if command == ANSWERED and 4 <= len(data) <= 8:
            number = struct.unpack_from("<xH", data)[0]
            self._answered[number] = data[4:]
            number_asked, layout = self._numbers.get(self._checks.open_question, (-1, ""))
            if number == number_asked and len(data) >= 4 + struct.calcsize(layout):
                self._check(float(struct.unpack_from(layout, data, 4)[0]), frame.time)
            return True
        if len(data) != 8:
            return False
        if command == ESTIMATES:
            angle, rate = struct.unpack("<ff", data)
            if not (math.isfinite(angle) and math.isfinite(rate)) or self.has_said(data, TURN * rate, frame.time):
                return False
            self.reading = DriveReading(frame.time, self.own(TURN * angle), self.own(TURN * rate))
        elif command == HEARTBEAT_ID:
            errors, state = struct.unpack_from("<IB", data)
            self._beats += 1
            self._says(errors, state, frame.time)
        elif command == VERSION:
            self._version = data
        elif command == SUPPLY:
            voltage, current = struct.unpack("<ff", data)
            if math.isfinite(voltage) and math.isfinite(current):
                self.supply, self.power = voltage, voltage * current
        else:
            return False
        return True
