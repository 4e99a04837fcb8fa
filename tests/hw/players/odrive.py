"""An ODrive's axis, as firmware 0.6 has it on a CAN bus.

Every frame to it feeds its watchdog, as in the sources of 0.5: MET relies on the worse of both behaviours.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

from hw.drives.drive import CanFrame
from tests.hw.players.player import PlayedDrive
from tests.hw.players.shaft import OFF, Output

PROPERTIES = (
    ("vbus_voltage", "float"),
    ("config.dc_bus_overvoltage_trip_level", "float"),
    ("axis0.config.enable_watchdog", "bool"),
    ("axis0.config.watchdog_timeout", "float"),
    ("axis0.config.motor.torque_constant", "float"),
    ("axis0.config.motor.current_soft_max", "float"),
    ("axis0.controller.config.vel_limit", "float"),
    ("axis0.config.can.heartbeat_msg_rate_ms", "uint32"),
    ("axis0.config.can.encoder_msg_rate_ms", "uint32"),
    ("axis0.config.can.bus_voltage_msg_rate_ms", "uint32"),
    ("axis0.config.torque_soft_max", "float"),
    ("axis0.config.torque_soft_min", "float"),
    ("axis0.controller.config.vel_gain", "float"),
    ("axis0.controller.config.vel_integrator_gain", "float"),
    (MODE := "axis0.controller.config.control_mode", "uint8"),
    ("axis0.controller.config.input_mode", "uint8"),
    (INPUT_TORQUE := "axis0.controller.input_torque", "float"),
    (INPUT_RATE := "axis0.controller.input_vel", "float"),
)
FIRST = 201
FORMATS = {"float": "<f", "bool": "<?", "uint32": "<I", "uint8": "<B"}
REPEATED = tuple(
    (command, f"axis0.config.can.{name}_msg_rate_ms")
    for command, name in ((0x01, "heartbeat"), (0x09, "encoder"), (0x17, "bus_voltage"))
)
"""Messages that it sends by itself, and the property that says how often, ms; 0: never."""


def endpoints(firmware: str = "0.6.10", hardware: str = "4.4.58") -> dict[str, Any]:
    """The maker's file of properties, as far as there are any here."""
    found = {path: {"id": FIRST + n, "type": kind} for n, (path, kind) in enumerate(PROPERTIES)}
    return {"fw_version": firmware, "hw_version": hardware, "endpoints": found}


class PlayedOdrive(PlayedDrive):
    """An ODrive's axis.

    kt N m/A; current_max A; rate_max rad/s; rate_gain N m s/rad and rate_integral N m/rad, of its rate loop
    watches    False for one whose watchdog does nothing
    saved      its properties after it was switched on
    version    protocol, hardware (three numbers), firmware (three), unreleased; None: it does not answer
    """

    def __init__(
        self,
        node: int,
        sense: int = 1,
        *,
        kt: float = 0.06,
        current_max: float = 10.0,
        rate_max: float = 400.0,
        supply: float = 24.0,
        supply_max: float = 56.0,
        rate_gain: float = 0.01,
        rate_integral: float = 0.05,
    ) -> None:
        super().__init__(node, sense)
        self.watches = True
        self.version: tuple[int, ...] | None = (2, 4, 4, 58, 0, 6, 10, 0)
        turn = 2.0 * math.pi
        drive = (supply, supply_max, False, 0.1, kt, current_max, rate_max / turn, 100, 10, 0)
        values = (*drive, math.inf, -math.inf, turn * rate_gain, turn * rate_integral, 3, 1, 0.0, 0.0)
        self.values = dict(zip((path for path, _ in PROPERTIES), values, strict=True))
        self.refuses: set[str] = set()
        """Properties that cannot be set."""
        self.state, self.errors, self.torque, self.fed = 1, 0, 0.0, 0.0
        self.rate_told, self.integral, self.looped = 0.0, 0.0, 0.0
        self.saved = dict(self.values)
        self._sent = {1: 0.0, 9: 0.0, 0x17: 0.0}

    def reboot(self) -> None:
        """Restart as after a loss of supply: unsaved values are gone."""
        self.state, self.errors, self.torque, self.rate_told, self.integral = 1, 0, 0.0, 0.0, 0.0
        self.values = dict(self.saved)
        self._sent = dict.fromkeys(self._sent, -math.inf)

    @property
    def mode(self) -> int:
        """Mode of its control: 1 torque, 2 rate."""
        return int(self.values[MODE])

    @property
    def bridge(self) -> Output:
        return Output("torque", self.torque) if self.state == 8 else OFF

    def _frame(self, command: int, data: bytes) -> CanFrame:
        return CanFrame(self.node << 5 | command, data)

    def receive(self, frame: CanFrame, now: float) -> Sequence[CanFrame]:
        if frame.extended or frame.fd or frame.id >> 5 != self.node:
            return ()
        self.fed = now
        command, data = frame.id & 0x1F, frame.data
        if frame.remote:
            return self._asked(command)
        if command == 0x02:
            self._failed(1 << 25)
        elif command == 0x04 and len(data) >= 4:
            return self._property(data)
        elif command == 0x07 and len(data) >= 4:
            wanted = struct.unpack_from("<I", data)[0]
            if wanted == 8 and not self.errors:
                self.state = 8
            elif wanted == 1:
                self.state, self.torque, self.integral = 1, 0.0, 0.0
        elif command == 0x0B and len(data) >= 8:
            self.values[MODE] = struct.unpack_from("<I", data)[0]
        elif command == 0x0D and len(data) >= 8:
            told = struct.unpack_from("<f", data)[0]
            self._told_rate(told)
            self._told_torque(struct.unpack_from("<f", data, 4)[0])
        elif command == 0x0E and len(data) >= 4:
            self._told_torque(struct.unpack_from("<f", data)[0])
        elif command == 0x18:
            self.errors = 0
        return ()

    def _told_rate(self, told: float) -> None:
        """Take a rate, turns/s."""
        most = self.values["axis0.controller.config.vel_limit"]
        self.values[INPUT_RATE] = told
        self.rate_told = 2.0 * math.pi * min(max(told, -most), most) if math.isfinite(told) else 0.0

    def _told_torque(self, told: float) -> None:
        """Take a torque, N m, which is in force in the mode of torques."""
        self.values[INPUT_TORQUE] = told
        if self.mode == 1:
            self.torque = self._limited(told) if math.isfinite(told) else 0.0

    def _limited(self, torque: float) -> float:
        """A torque within the limits of its current and of its torque, N m."""
        most = self.values["axis0.config.motor.torque_constant"] * self.values["axis0.config.motor.current_soft_max"]
        least = max(self.values["axis0.config.torque_soft_min"], -most)
        return min(max(torque, least), self.values["axis0.config.torque_soft_max"], most)

    def _close_loop(self, now: float) -> None:
        """Set the torque by the rate's error and its integral, which fades while the torque is limited, as in the
        sources of 0.5."""
        passed, self.looped = now - self.looped, now
        if self.state != 8 or self.mode != 2:
            return
        error = (self.rate_told - self.rate) / (2.0 * math.pi)
        wanted = self.values["axis0.controller.config.vel_gain"] * error + self.integral
        self.torque = self._limited(wanted)
        if self.torque != wanted:
            self.integral *= 0.99 ** (8000.0 * passed)  # a hundredth of it in each of its ticks
        else:
            self.integral += self.values["axis0.controller.config.vel_integrator_gain"] * passed * error

    def _asked(self, command: int) -> Sequence[CanFrame]:
        if command == 0x00 and self.version is not None:
            return (self._frame(command, bytes(self.version)),)
        data = self._said(command)
        return () if data is None else (self._frame(command, data),)

    def _said(self, command: int) -> bytes | None:
        if command == 0x01:
            return struct.pack("<IBBBB", self.errors, self.state, 0, 0, 0)
        if command == 0x09:
            return struct.pack("<ff", self.angle / (2.0 * math.pi), self.rate / (2.0 * math.pi))
        if command == 0x17:
            return struct.pack(
                "<ff", self.values["vbus_voltage"], self.bridge.value * self.rate / self.values["vbus_voltage"]
            )
        return None

    def _property(self, data: bytes) -> Sequence[CanFrame]:
        write, number = struct.unpack_from("<BH", data)
        if not FIRST <= number < FIRST + len(PROPERTIES):
            return ()
        path, kind = PROPERTIES[number - FIRST]
        layout = FORMATS[kind]
        if write == 1 and len(data) >= 4 + struct.calcsize(layout) and path not in self.refuses:
            self.values[path] = struct.unpack_from(layout, data, 4)[0]
        if write:
            return ()
        return (self._frame(0x05, struct.pack("<xHx", number) + struct.pack(layout, self.values[path])),)

    def tick(self, now: float) -> Sequence[CanFrame]:
        self._watch(now)
        out = []
        for command, name in REPEATED:
            period = 1e-3 * self.values[name]
            if period and now - self._sent[command] >= period - 1e-9:
                data = self._said(command)
                assert data is not None
                self._sent[command] = now
                out.append(self._frame(command, data))
        return out

    def _watch(self, now: float) -> None:
        """Watch what stops it, and close its rate loop."""
        if self.state != 8:
            self.looped = now
            return
        timeout = self.values["axis0.config.watchdog_timeout"]
        if self.watches and self.values["axis0.config.enable_watchdog"] and now - self.fed > timeout:
            self._failed(1 << 24)
        self._close_loop(now)
        if self.state == 8 and self.values["vbus_voltage"] > self.values["config.dc_bus_overvoltage_trip_level"]:
            self._failed(1 << 8)

    def _failed(self, error: int) -> None:
        self.errors, self.state, self.torque, self.integral = self.errors | error, 1, 0.0, 0.0
