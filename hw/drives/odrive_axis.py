"""An ODrive's axis, of firmware 0.6, whatever carries its properties and commands: what is set and read at a greeting,
and what its state and errors mean. On a CAN bus hw/drives/odrive.py speaks to it, on a serial line
hw/drives/odrive_ascii.py.

Facts are from ODrive's documentation; no ODrive was there. What a property is set to here is not saved: the drive has
its own after it was switched off.
"""

from __future__ import annotations

import math
from abc import abstractmethod

from hw.drives.bench_file import DriveEntry
from hw.drives.checks import SELDOM, SetpointChecks
from hw.drives.drive import ASKS, CanDrive, DriveFacts, DriveState, Talk

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

CONTROL_HZ = 8000.0
"""Rate of the drive's own control, Hz."""

FIRMWARE = (0, 6)
KT_TOLERANCE = 0.02
"""Share by which the drive's torque constant may differ from that of the bench file."""

TURN = 2.0 * math.pi
"""rad of the turns in which an ODrive tells angles and rates."""

WATCHDOG_TIMEOUT, WATCHDOG_ENABLED = "axis0.config.watchdog_timeout", "axis0.config.enable_watchdog"
TORQUE_CONSTANT, CURRENT_MAX = "axis0.config.motor.torque_constant", "axis0.config.motor.current_soft_max"
RATE_MAX, SUPPLY_MAX = "axis0.controller.config.vel_limit", "config.dc_bus_overvoltage_trip_level"
TORQUE_MOST, TORQUE_LEAST = "axis0.config.torque_soft_max", "axis0.config.torque_soft_min"
RATE_GAIN, RATE_INTEGRAL = "axis0.controller.config.vel_gain", "axis0.controller.config.vel_integrator_gain"
CONTROL_MODE, INPUT_MODE = "axis0.controller.config.control_mode", "axis0.controller.config.input_mode"
INPUT_TORQUE, INPUT_RATE = "axis0.controller.input_torque", "axis0.controller.input_vel"
LIMITS = (WATCHDOG_TIMEOUT, WATCHDOG_ENABLED, TORQUE_CONSTANT, CURRENT_MAX, RATE_MAX, SUPPLY_MAX)
NEEDED = (*LIMITS, CONTROL_MODE, INPUT_MODE, TORQUE_MOST, TORQUE_LEAST, INPUT_TORQUE, INPUT_RATE)
NEEDED_FOR_RATES = (RATE_GAIN, RATE_INTEGRAL)
"""Properties needed with rate commands: the loop's gains, N m s/turn and N m/turn."""


class OdriveAxis(CanDrive):
    """The host's side of an ODrive's axis, without its transport."""

    takes_rates = True
    unseen = f"on another port of a drive, such as USB, {SELDOM}"

    def __init__(self, entry: DriveEntry) -> None:
        super().__init__(entry)
        self._written: dict[str, float] = {}
        """Properties that were set, with their values, by path."""
        self._checks = SetpointChecks()

    @property
    def _mode(self) -> int:
        """The mode of its control: rate or torque commands."""
        return RATE_CONTROL if self.rates else TORQUE_CONTROL

    def renew(self, talk: Talk) -> None:
        for path, value in self._written.items():
            self._write(talk, path, value)

    def _check(self, value: float, time: float) -> None:
        """Take the drive's answer to what command it has; one that this host did not send is another master's. time: of
        the line's clock, s"""
        if what := self._checks.answered(value, time):
            self.disturbed = f"{self.words} was commanded by another: {what}"

    @abstractmethod
    def _read(self, talk: Talk, path: str) -> float:
        """A property. Raises Problem E402 to E404."""

    @abstractmethod
    def _put(self, talk: Talk, path: str, value: float) -> None:
        """Send the setting of a property, which has no answer."""

    def _write(self, talk: Talk, path: str, value: float) -> None:
        """Set a property, and see that it is set. Raises Problem E404 where it is not."""
        for _ in range(ASKS):
            self._put(talk, path, value)
            value_read = self._read(talk, path)
            if abs(value_read - value) <= 1e-6 * abs(value):
                self._written[path] = value
                return
        raise self.wrong(
            f"it does not take {value:g} for `{path}`, which is {value_read:g}", "set it by its maker's tool"
        )

    def _check_firmware(self, firmware: tuple[int, ...]) -> None:
        """Raise Problem E403 where MET does not speak to a firmware: its numbers, the first first."""
        if firmware[:2] != FIRMWARE:
            words = ".".join(str(number) for number in firmware)
            raise self.other(f"its firmware is {words}", "MET speaks to firmware 0.6")

    def _described(self, talk: Talk, firmware: str, hardware: str) -> DriveFacts:
        """Set the drive's watchdog, mode and largest torque, and read its limits and its rate loop. Raises Problem E402
        to E404.

        The largest torque is set whatever it is told, for it stays until the drive is switched off: a bench that is
        told torques would else keep that of the one that was told rates before.
        """
        bears = self.bears
        for path, value in (
            (WATCHDOG_TIMEOUT, self.entry.figures["watchdog"]),
            (WATCHDOG_ENABLED, True),
            (CONTROL_MODE, self._mode),
            (INPUT_MODE, PASSTHROUGH),
            (TORQUE_MOST, bears),
            (TORQUE_LEAST, -bears),
            (INPUT_TORQUE if self.rates else INPUT_RATE, 0.0),  # what it is not told
        ):
            self._write(talk, path, value)
        kt, current = self._read(talk, TORQUE_CONSTANT), self._read(talk, CURRENT_MAX)
        own = self.entry.figures["kt"]
        if not abs(kt - own) <= KT_TOLERANCE * own:
            helps = "what they are told is a torque: the drive makes its current of it by its own constant"
            raise self.wrong(f"its torque constant is {kt:.4g} N*m/A, and the bench file's {own:.4g}", helps)
        rate = TURN * self._read(talk, RATE_MAX)
        supply = self._read(talk, SUPPLY_MAX)
        watchdog = self._read(talk, WATCHDOG_TIMEOUT)
        if not all(math.isfinite(figure) and figure > 0.0 for figure in (kt, current, rate, supply, watchdog)):
            raise self.wrong("a limit of its is no number above zero", f"{', '.join(LIMITS)}: set them")
        loop = self._rate_loop(talk) if self.rates else None
        commanded = (INPUT_RATE, INPUT_TORQUE) if self.rates else (INPUT_TORQUE,)
        paths = dict.fromkeys((*NEEDED, *NEEDED_FOR_RATES * self.rates))
        self._checks.begin(commanded, {path: self._read(talk, path) for path in paths if path not in commanded})
        most = kt * current
        return DriveFacts(firmware, hardware, watchdog, most, rate, CONTROL_HZ, supply_max=supply, rate_loop=loop)

    def _rate_loop(self, talk: Talk) -> tuple[float, float]:
        """Read the gains of the drive's rate loop, N m s/rad and N m/rad."""
        gain, integral = (self._read(talk, path) / TURN for path in (RATE_GAIN, RATE_INTEGRAL))
        if not (math.isfinite(gain) and math.isfinite(integral) and gain > 0.0 and integral >= 0.0):
            raise self.wrong("its rate loop has no gain above zero", f"{RATE_GAIN}, {RATE_INTEGRAL}: set them")
        return gain, integral

    def _says(self, errors: int, state: int, time: float) -> None:
        """Take the drive's errors (bits) and state (its number). time: of the line's clock, s"""
        self.stated = time
        self.errors = ", ".join(words for bit, words in ERRORS.items() if errors & bit)
        if errors & ~sum(ERRORS):
            self.errors += f"{', ' if self.errors else ''}error 0x{errors:X}"
        self.starved = errors == WATCHDOG_EXPIRED
        if state == CLOSED_LOOP:  # whatever its errors
            self.state = DriveState.DRIVING
        else:
            self.state = DriveState.FAILED if errors else DriveState.IDLE
