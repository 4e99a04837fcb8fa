"""A bed in this process: a simulated plant under the rules of a real one, and the counts of its wire.

In lock-step: a tick is an exchange. What needs a line or a clock is not there: no deadman, no noise, no watchdog; nor
is the tachometer watched, for the plant's is sound.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

from hw import refusals
from hw.bed import About, BedDriver, BedSample, BedState, Capability, Fault, Limits, Scales
from hw.beds import greeting
from hw.ports import Opening, PortKind
from hw.protocol import messages
from met.diagnostic import Problem, error
from met.plant import Plant
from met.substitution.bed import SIMULATION_PARAMETERS, DriveCommand

FINE = 2.0**-20
"""V, A or rad/s of a count where the bed's converter has no resolution. Commands reach 2047 of the unit, and a
product with the count is exact."""

WIDE = 2.0
"""Limit of the torque that a bed may be told, in units of the largest that its drive gives."""

FINE_ANGLE = 2.0**-16
"""rad of a count of the encoder."""

ARMING_RATE = 5.0
"""Rate above which the bed does not arm, rad/s: no one would call that turning, and typical noise of a tachometer is
a tenth of it."""

DEADMAN = 0.020
"""The deadman's time that the bed announces, s. Nothing waits for it in lock-step."""


class SteppedPlant(Protocol):
    """A simulated motor bed that is stepped by hand. period: s of a tick; shaft_angle: rad."""

    period: float

    def start(self, rate: float, seed: float, repeat: float) -> float:
        """Let the shaft have turned at rate (rad/s) for long, with noise from its beginning. Returns the filtered
        rate, rad/s."""

    def tick(self, voltage: float, current: float) -> float:
        """Advance one tick with the amplifiers' held outputs, V and A. Returns the filtered rate after it, rad/s."""

    @property
    def shaft_angle(self) -> float:
        """The shaft's angle, rad."""


def scales(values: Mapping[str, float], drive: DriveCommand = "voltage") -> Scales:
    """The counts of a bed with these parameters (met.substitution.bed): a count is a step of its converters."""
    volts, amperes, rate = (
        values.get(name, 0.0) or FINE for name in (f"converter_{drive}", "converter_current", "converter_in")
    )
    return Scales(volts, amperes, rate, FINE_ANGLE, FINE, FINE)


def limits(values: Mapping[str, float], period: float, *, voltage: float = 60.0, rate: float = 1000.0) -> Limits:
    """The limits of a bed with these parameters. Its current is that of the load's amplifier, which it bears for
    ever. The others are wide unless given (V, rad/s), and within a tick of `period` s all of a range may be
    commanded."""
    current = values["i_max"]
    heat = current * current  # not a power, which overflows with an error
    return Limits(voltage, current, rate, ARMING_RATE, 2.0 * voltage / period, 2.0 * current / period, heat)


class EmulatedBed(BedDriver):
    """A bed in this process, in lock-step: a plant under the states, limits and counts of a real bed.

    plant             at rest when the driver is made
    bears             A that the load motor bears for ever; its limit unless given
    drive             what its drive is told
    voltage, current  what the amplifiers hold: V, A
    """

    has_line = False

    def __init__(
        self,
        plant: SteppedPlant,
        scales: Scales,
        limits: Limits,
        *,
        name: str = "emulated",
        bears: float | None = None,
        drive: DriveCommand = "voltage",
    ) -> None:
        """scales: SI units of a count; limits: the bed's own, in SI"""
        self._plant, self._name, self._scales, self._limits, self._drive = plant, name, scales, limits, drive
        self._bears = limits.current if bears is None else bears
        self._about: About | None = None
        self._rate = self._counted(plant.start(0.0, 0.0, 0.0))
        self._state, self._faults, self._tick, self._heat = BedState.DISARMED, Fault(0), 0, 0.0
        self._volts, self._amperes, self._since = 0, 0, 0
        self.voltage, self.current = 0.0, 0.0

    def connect(self) -> About:
        """Describe the bed, which is at hand at once, and disarm it."""
        capabilities = Capability.ENCODER | Capability.LOCK_STEP | Capability.SIMULATED
        about = About(
            self._name,
            messages.VERSION,
            "0" * 16,
            1,
            capabilities,
            1.0 / self._plant.period,
            DEADMAN,
            self._scales,
            self._limits,
            self._drive,
        )
        self.stop()
        self._about, self._in_force = about, greeting.in_force(about)
        return about

    def limit(self, requested: Mapping[str, float]) -> None:
        """Make limits tighter. Raises Problem E406 unless the bed is disarmed."""
        about = self._require_about()
        tighter = greeting.tighter(about, requested)
        if self._state != BedState.DISARMED:
            raise refusals.refused(about, "take tighter limits", self._sample(refused=True))
        own = greeting.in_force(about)
        self._in_force = replace(
            self._in_force, **{name: min(most, getattr(own, name)) for name, most in tighter.items()}
        )

    def arm(self) -> BedSample:
        """Arm the simulated bed with 0 commanded. Raises Problem E406 unless it is disarmed and slow."""
        about = self._require_about()
        if self._state != BedState.DISARMED or not self._slow():
            raise refusals.refused(about, "arm", self._sample(refused=True))
        self._hold(0, 0)
        self._state, self._since = BedState.ARMED, 0
        return self._sample()

    def exchange(self, voltage: float, current: float) -> BedSample | None:
        """Set both commands, and advance the simulated plant by a period. A step of a command that is beyond its slew
        limit is a fault."""
        about, force = self._require_about(), self._in_force
        volts, amperes = greeting.commanded(self, about, force, voltage, current)
        armed = self._state == BedState.ARMED
        if armed:
            since = max(self._since, 1)
            if (
                abs(volts - self._volts) > since * force.voltage_slew
                or abs(amperes - self._amperes) > since * force.current_slew
            ):
                self._stopped(Fault.SLEW)
            else:
                self._hold(volts, amperes)
                self._since = 0
        self._advance()
        return self._sample(refused=not armed)

    def read(self) -> BedSample:
        self._require_about()
        return self._sample()

    def clear(self) -> BedSample:
        """Forget latched faults. Raises Problem E406 while the bed is armed, hot or not at rest."""
        about = self._require_about()
        hot = Fault.HEAT in self._faults and self._heat > self._limits.heat / 2.0
        if self._state == BedState.ARMED or (self._state == BedState.STOPPED and (hot or not self._slow())):
            raise refusals.refused(about, "clear", self._sample(refused=True))
        self._state, self._faults = BedState.DISARMED, Fault(0)
        return self._sample()

    def rest(self, time: float) -> BedSample:
        """Stop, and advance the simulated shaft by `time` s."""
        self._require_about()
        self.stop()
        for _ in range(math.ceil(time / self._plant.period - 1e-6)):
            self._advance()
        return self._sample()

    def preset(self, *, rate: float = 0.0, seed: int = 0, repeat: int = 0) -> BedSample:
        """Start the simulated shaft anew. Raises Problem E406 unless the bed is disarmed."""
        about = self._require_about()
        if self._state != BedState.DISARMED or not math.isfinite(rate):
            raise refusals.refused(about, "start its plant anew", self._sample(refused=True))
        self._rate = self._counted(self._plant.start(rate, float(seed), float(repeat)))
        return self._sample()

    def stop(self) -> bool:
        self._hold(0, 0)
        if self._state == BedState.ARMED:
            self._state = BedState.DISARMED
        return True

    def close(self) -> None:
        self.stop()
        self._about = None

    def _require_about(self) -> About:
        if self._about is None:
            raise refusals.not_connected(self._name)
        return self._about

    def _counted(self, rate: float) -> int:
        """The rate in whole counts; one that has no count, or is not a number, is the largest, which is beyond every
        limit."""
        counts = rate / self._scales.rate
        return round(counts) if abs(counts) < messages.MOST else messages.MOST

    def _slow(self) -> bool:
        return abs(self._rate) <= greeting.counts(self._limits.arming_rate, self._scales.rate)

    def _hold(self, volts: int, amperes: int) -> None:
        self._volts, self._amperes = volts, amperes
        self.voltage, self.current = volts * self._scales.voltage, amperes * self._scales.current

    def _stopped(self, faults: Fault) -> None:
        self._hold(0, 0)
        self._state = BedState.STOPPED
        self._faults |= faults

    def _advance(self) -> None:
        """Advance the simulated shaft by a tick, and stop where the rate or the heat is beyond its limit."""
        self._rate = self._counted(self._plant.tick(self.voltage, self.current))
        self._tick += 1
        self._since += 1
        gained = (self.current * self.current - self._bears * self._bears) * self._plant.period
        self._heat = max(0.0, self._heat + gained)
        if self._state == BedState.ARMED:
            if abs(self._rate) > self._in_force.rate:
                self._stopped(Fault.RATE)
            if self._heat > self._limits.heat:
                self._stopped(Fault.HEAT)

    def _sample(self, *, refused: bool = False) -> BedSample:
        angle = round(self._plant.shaft_angle / self._scales.angle) * self._scales.angle
        rate = self._rate * self._scales.rate
        return BedSample(self._state, True, self._faults, refused, self._tick, rate, angle)


def _opened_port(opening: Opening) -> EmulatedBed:
    """The bed of `--port emulated`, from the deck's model of it. Raises Problem E409 where a transcript is asked
    for."""
    if opening.port.transcript is not None:
        helps = "`--port firmware` has one; with `--lock-step` it gives the same bits"
        raise Problem(error("E409", "an emulated bed has no line whose transcript could be kept", help=helps))
    values = opening.bed_values()
    experiment = opening.simulated()
    plant = Plant(experiment, opening.joint, case=opening.row, period=opening.period)
    drive = opening.drive or "voltage"
    most = {} if drive == "voltage" else {"voltage": WIDE * values["tau_max"]}
    return EmulatedBed(plant, scales(values, drive), limits(values, opening.period, **most), drive=drive)


PORT = PortKind(
    scheme="emulated",
    doc="The deck's bed, emulated in this process, in lock-step.",
    open=_opened_port,
    simulated=True,
    needs=tuple(parameter for parameter in SIMULATION_PARAMETERS if parameter.name == "i_max"),
    lock_step=lambda name, requested: True,
)
