"""ODrive's CANSimple, of firmware 0.6: classic frames whose identifier is node << 5 | command, floats in turns.

    asked for           request without data, answered under the same identifier: version, estimates
    by itself           heartbeat with state and errors, every `HEARTBEAT`; voltage and current of the supply
    told                torque, N m of the motor's shaft, or its rate, turns/s; nothing answers it
    properties          read and written by number; a file of the firmware's maker, flat_endpoints.json, has them

Facts are from ODrive's documentation of the protocol and from what implements it; no ODrive was there. What a property
is set to here is not saved: the drive has its own after it was switched off.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from typing import Any

from hw.drives.bench_file import DriveEntry
from hw.drives.drive import ASKS, CanDrive, DriveFacts, DriveReading, DriveState, Talk
from hw.drives.frames import CanFrame
from met.host.files import read_regular

VERSION, HEARTBEAT_ID, ESTOP, READ_OR_WRITE, ANSWERED, SET_STATE = 0x00, 0x01, 0x02, 0x04, 0x05, 0x07
ESTIMATES, MODES, RATE, TORQUE, SUPPLY, CLEAR = 0x09, 0x0B, 0x0D, 0x0E, 0x17, 0x18
"""Commands, the lower five bits of an identifier."""

IDLE, CLOSED_LOOP = 1, 8
TORQUE_CONTROL, RATE_CONTROL, PASSTHROUGH = 1, 2, 1
WATCHDOG_EXPIRED, ESTOP_REQUESTED = 1 << 24, 1 << 25
ERRORS = {
    1: "initializing",
    1 << 1: "system level",
    1 << 2: "timing",
    1 << 3: "missing estimate",
    1 << 4: "bad configuration",
    1 << 5: "gate driver",
    1 << 6: "missing input",
    1 << 8: "supply over voltage",
    1 << 9: "supply under voltage",
    1 << 10: "supply over current",
    1 << 11: "more current given back than is allowed",
    1 << 12: "current limit",
    1 << 13: "motor too hot",
    1 << 14: "inverter too hot",
    1 << 15: "velocity limit",
    1 << 16: "position limit",
    WATCHDOG_EXPIRED: "watchdog expired",
    ESTOP_REQUESTED: "told to stop",
    1 << 26: "spinout",
    1 << 27: "brake resistor disarmed",
    1 << 28: "thermistor disconnected",
    1 << 30: "calibration",
}

HEARTBEAT_MS, SUPPLY_MS = 5, 20
"""Periods at which a drive is set to tell its state, and its supply's voltage and current, ms."""

CONTROL_HZ = 8000.0
"""Rate of the drive's own control, Hz."""

FIRMWARE = (0, 6)
KT_TOLERANCE = 0.02
"""Share by which the drive's torque constant may differ from that of the bench file."""

MOST_NODE = 62
"""Largest number of a drive: an identifier has six bits for it, and 63 is one that has none."""

MOST_BYTES = 1 << 20
_TYPES = {"bool": "<?", "uint8": "<B", "int8": "<b", "uint16": "<H", "int16": "<h", "uint32": "<I", "int32": "<i"}
_TYPES |= {"float": "<f"}
_TURN = 2.0 * math.pi

HEARTBEAT_RATE = "axis0.config.can.heartbeat_msg_rate_ms"
ESTIMATES_RATE = "axis0.config.can.encoder_msg_rate_ms"
SUPPLY_RATE = "axis0.config.can.bus_voltage_msg_rate_ms"
WATCHDOG_TIMEOUT, WATCHDOG_ENABLED = "axis0.config.watchdog_timeout", "axis0.config.enable_watchdog"
TORQUE_CONSTANT, CURRENT_MAX = "axis0.config.motor.torque_constant", "axis0.config.motor.current_soft_max"
RATE_MAX, SUPPLY_MAX = "axis0.controller.config.vel_limit", "config.dc_bus_overvoltage_trip_level"
TORQUE_MOST, TORQUE_LEAST = "axis0.config.torque_soft_max", "axis0.config.torque_soft_min"
RATE_GAIN, RATE_INTEGRAL = "axis0.controller.config.vel_gain", "axis0.controller.config.vel_integrator_gain"
CONTROL_MODE, INPUT_MODE = "axis0.controller.config.control_mode", "axis0.controller.config.input_mode"
NEEDED_FOR_RATES = (TORQUE_MOST, TORQUE_LEAST, RATE_GAIN, RATE_INTEGRAL)
"""Properties of one that is told rates: the torque that its loop may ask for, N m; its gains, N m s/turn, N m/turn."""
NEEDED = (
    HEARTBEAT_RATE,
    ESTIMATES_RATE,
    SUPPLY_RATE,
    WATCHDOG_TIMEOUT,
    WATCHDOG_ENABLED,
    TORQUE_CONSTANT,
    CURRENT_MAX,
    RATE_MAX,
    SUPPLY_MAX,
    CONTROL_MODE,
    INPUT_MODE,
)


def _endpoint(found: Any) -> tuple[int, str]:
    """The number of a property, of 16 bits, and the format of its value. Raises ValueError, KeyError, TypeError."""
    number = found["id"]
    if type(number) is not int or not 0 <= number < 1 << 16:
        raise ValueError
    return number, _TYPES[found["type"]]


class OdriveDrive(CanDrive):
    """The host's side of an ODrive's axis."""

    dialect = "odrive"
    takes_rates = True

    def __init__(self, entry: DriveEntry) -> None:
        super().__init__(entry)
        self._version: bytes | None = None
        self._answered: dict[int, bytes] = {}
        self._written: dict[str, tuple[dict[str, Any], float]] = {}
        """Properties that were set, and to what: endpoints and value of each, by path."""
        self._beats = 0

    def greet(self, talk: Talk) -> DriveFacts:
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
        words = ".".join(str(each) for each in firmware), ".".join(str(each) for each in hardware)
        if firmware[:2] != FIRMWARE:
            raise self.other(f"its firmware is {words[0]}", "MET speaks to firmware 0.6")
        talk.send(self.idle())
        endpoints = self._endpoints(*words)
        for path, value in (
            (HEARTBEAT_RATE, HEARTBEAT_MS),
            (ESTIMATES_RATE, 0),
            (SUPPLY_RATE, SUPPLY_MS),
            (WATCHDOG_TIMEOUT, self.entry.figures["watchdog"]),
            (WATCHDOG_ENABLED, True),
            (CONTROL_MODE, self._mode),
            (INPUT_MODE, PASSTHROUGH),
        ):
            self._write(talk, endpoints, path, value)
        kt, current = self._read(talk, endpoints, TORQUE_CONSTANT), self._read(talk, endpoints, CURRENT_MAX)
        own = self.entry.figures["kt"]
        if not abs(kt - own) <= KT_TOLERANCE * own:
            helps = "what they are told is a torque: the drive makes its current of it by its own constant"
            raise self.wrong(f"its torque constant is {kt:.4g} N*m/A, and the bench file's {own:.4g}", helps)
        rate = _TURN * self._read(talk, endpoints, RATE_MAX)
        supply = self._read(talk, endpoints, SUPPLY_MAX)
        watchdog = self._read(talk, endpoints, WATCHDOG_TIMEOUT)
        if not all(math.isfinite(each) and each > 0.0 for each in (kt, current, rate, supply, watchdog)):
            raise self.wrong("a limit of its is no number above zero", f"{', '.join(NEEDED[3:-2])}: set them")
        loop = self._rate_loop(talk, endpoints) if self.rates else None
        most = kt * current if loop is None else min(kt * current, self._read(talk, endpoints, TORQUE_MOST))
        seen = self._beats
        if not talk.pump(talk.line.now() + 0.5, lambda: self._beats > seen + 1 and self.state != DriveState.DRIVING):
            raise talk.silent(self, "its heartbeat")
        return DriveFacts(words[0], words[1], watchdog, most, rate, CONTROL_HZ, supply_max=supply, rate_loop=loop)

    def _rate_loop(self, talk: Talk, endpoints: dict[str, Any]) -> tuple[float, float]:
        """Let the drive's rate loop ask for no more torque than the bench bears. Returns its gains, N m s/rad and
        N m/rad."""
        most = self.entry.figures["torque_max"]
        for path, value in ((TORQUE_MOST, most), (TORQUE_LEAST, -most)):
            self._write(talk, endpoints, path, value)
        gain, integral = (self._read(talk, endpoints, path) / _TURN for path in (RATE_GAIN, RATE_INTEGRAL))
        if not (math.isfinite(gain) and math.isfinite(integral) and gain > 0.0 and integral >= 0.0):
            raise self.wrong("its rate loop has no gain above zero", f"{RATE_GAIN}, {RATE_INTEGRAL}: set them")
        return gain, integral

    def renew(self, talk: Talk) -> None:
        for path, (endpoints, value) in self._written.items():
            self._write(talk, endpoints, path, value)

    def _endpoints(self, firmware: str, hardware: str) -> dict[str, Any]:
        """The numbers of its properties, for the firmware that it has. Raises Problem E403, E404."""
        path = self.entry.endpoints
        helps = f"its maker has flat_endpoints.json for firmware {firmware} and hardware {hardware}"
        if not path:
            raise self.wrong("the bench file does not say where its properties are", (f"`endpoints`: {helps}"))
        try:
            data = json.loads(read_regular(path, MOST_BYTES))
            found, named = data["endpoints"], (data["fw_version"], data["hw_version"])
            needed = (*NEEDED, *NEEDED_FOR_RATES * self.rates)
            missing = [each for each in needed if each not in found]
            numbers = {each: _endpoint(found[each]) for each in needed if each in found}
        except OSError as reason:
            raise self.wrong(f"{path} cannot be read: {(reason.strerror or str(reason)).lower()}", helps) from None
        except (ValueError, KeyError, TypeError, RecursionError):
            raise self.wrong(f"{path} is no file of its properties", helps) from None
        if missing:
            raise self.wrong(f"{path} has no `{missing[0]}`", helps)
        if named != (firmware, hardware):
            said = f"{path} is for firmware {named[0]}, hardware {named[1]}"
            raise self.other(f"it has {firmware}, hardware {hardware}, and {said}", helps)
        return numbers

    def _property(self, talk: Talk, number: int, payload: bytes) -> bytes:
        self._answered.pop(number, None)
        frame = self._frame(READ_OR_WRITE, payload)
        if not talk.ask([frame], lambda: number in self._answered):
            raise talk.silent(self, f"what its property {number} is")
        return self._answered[number]

    def _read(self, talk: Talk, endpoints: dict[str, Any], path: str) -> float:
        """A property, read until two answers in a row are the same: a limit is not taken from one frame."""
        number, layout = endpoints[path]
        before = b""
        for _ in range(ASKS):
            data = self._property(talk, number, struct.pack("<BHB", 0, number, 0))
            if data == before and len(data) >= struct.calcsize(layout):
                return float(struct.unpack_from(layout, data)[0])
            before = data
        raise self.wrong(f"it answers each time differently what `{path}` is", "two nodes of one number on the bus?")

    def _write(self, talk: Talk, endpoints: dict[str, Any], path: str, value: float) -> None:
        """Set a property, and see that it is set. Raises Problem E404 where it is not."""
        number, layout = endpoints[path]
        exact = value if layout == "<f" else int(value)
        for _ in range(ASKS):
            talk.send([self._frame(READ_OR_WRITE, struct.pack("<BHB", 1, number, 0) + struct.pack(layout, exact))])
            found = self._read(talk, endpoints, path)
            if abs(found - value) <= 1e-6 * abs(value):
                self._written[path] = endpoints, value
                return
        raise self.wrong(f"it does not take {value:g} for `{path}`, which is {found:g}", "set it by its maker's tool")

    # Frames

    @property
    def _mode(self) -> int:
        return RATE_CONTROL if self.rates else TORQUE_CONTROL

    def _request(self, command: int) -> CanFrame:
        return CanFrame(self.node << 5 | command, remote=True)

    def _frame(self, command: int, data: bytes = b"") -> CanFrame:
        return CanFrame(self.node << 5 | command, data)

    def armed(self) -> Sequence[CanFrame]:
        return (
            self._frame(MODES, struct.pack("<II", self._mode, PASSTHROUGH)),
            *self.told(0.0),
            self._frame(SET_STATE, struct.pack("<I", CLOSED_LOOP)),
        )

    def told(self, value: float) -> Sequence[CanFrame]:
        if self.rates:  # with no torque besides that of its loop
            return (self._frame(RATE, struct.pack("<ff", self.own(value) / _TURN, 0.0)),)
        return (self._frame(TORQUE, struct.pack("<f", self.own(value))),)

    def asked(self) -> Sequence[CanFrame]:
        return (self._request(ESTIMATES),)

    def idle(self) -> Sequence[CanFrame]:
        return (*self.told(0.0), self._frame(SET_STATE, struct.pack("<I", IDLE)))

    def halted(self) -> Sequence[CanFrame]:
        return (self._frame(ESTOP), *self.told(0.0))  # what it is told it would go on with once it is armed again

    def cleared(self) -> Sequence[CanFrame]:
        return (self._frame(CLEAR, b"\0"), *self.idle())

    def answers(self) -> Sequence[CanFrame]:
        return (self._frame(ESTIMATES, bytes(8)),)

    def take(self, frame: CanFrame) -> bool:
        if frame.extended or frame.fd or frame.remote or frame.id >> 5 != self.node:
            return False
        command, data = frame.id & 0x1F, frame.data
        if command == ANSWERED and 4 <= len(data) <= 8:
            self._answered[struct.unpack_from("<xH", data)[0]] = data[4:]
            return True
        if len(data) != 8:
            return False
        if command == ESTIMATES:
            angle, rate = struct.unpack("<ff", data)
            if not (math.isfinite(angle) and math.isfinite(rate)):
                return False
            self.reading = DriveReading(frame.time, self.own(_TURN * angle), self.own(_TURN * rate))
        elif command == HEARTBEAT_ID:
            errors, state = struct.unpack_from("<IB", data)
            self._beat(errors, state, frame.time)
        elif command == VERSION:
            self._version = data
        elif command == SUPPLY:
            voltage, current = struct.unpack("<ff", data)
            if math.isfinite(voltage) and math.isfinite(current):
                self.supply, self.power = voltage, voltage * current
        else:
            return False
        return True

    def _beat(self, errors: int, state: int, time: float) -> None:
        self._beats += 1
        self.stated = time
        self.errors = ", ".join(words for bit, words in ERRORS.items() if errors & bit)
        if errors & ~sum(ERRORS):
            self.errors += f"{', ' if self.errors else ''}error 0x{errors:X}"
        self.starved = errors == WATCHDOG_EXPIRED
        if state == CLOSED_LOOP:  # whatever its errors
            self.state = DriveState.DRIVING
        else:
            self.state = DriveState.FAILED if errors else DriveState.IDLE
