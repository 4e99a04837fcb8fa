"""The shaft that two played drives turn: an inertia with friction, or the bed of a deck."""

from __future__ import annotations

import math
from typing import Protocol

from met.frozen import frozen


@frozen
class Output:
    """What a drive's bridge does: `off`, a `torque` (N m), or `short`, its windings shorted."""

    kind: str = "off"
    value: float = 0.0


OFF = Output()


class PlayedShaft(Protocol):
    """A shaft that is stepped by hand. period s;  angle rad, rate rad/s"""

    period: float
    angle: float
    rate: float

    def step(self, drive: Output, load: Output) -> None:
        """Advance by a period under what the two drives do."""


class InertiaShaft:
    """A shaft with Coulomb and viscous friction, exact while its friction keeps its sign.

    inertia kg m^2;  kt N m/A and resistance ohm, of the drive under test;  f_c N m, f_v N m s/rad
    """

    def __init__(
        self, *, inertia: float, kt: float, resistance: float, f_c: float = 0.0, f_v: float = 0.0, period: float = 5e-4
    ) -> None:
        self.inertia, self.kt, self.resistance, self.f_c, self.f_v = inertia, kt, resistance, f_c, f_v
        self.period, self.angle, self.rate = period, 0.0, 0.0

    def step(self, drive: Output, load: Output) -> None:
        torque, brake = 0.0, self.f_v
        for each in (drive, load):
            if each.kind == "torque":
                torque += each.value
            elif each.kind == "short":
                brake += self.kt * self.kt / self.resistance
        rate = self.rate
        if rate == 0.0 and abs(torque) <= self.f_c:
            return
        way = math.copysign(1.0, rate if rate else torque)
        push = torque - way * self.f_c
        decay = brake / self.inertia
        if decay * self.period > 1e-9:
            last = push / brake
            self.rate = last + (rate - last) * math.exp(-decay * self.period)
        else:
            self.rate = rate + push / self.inertia * self.period
        if self.rate * way < 0.0:
            self.rate = 0.0
        self.angle += 0.5 * (rate + self.rate) * self.period


class DeckPlant(Protocol):
    """A deck's bed in this process (met.plant.Plant)."""

    period: float

    def start(self, rate: float, seed: float, repeat: float) -> float: ...

    def tick(self, voltage: float, current: float) -> float: ...

    @property
    def shaft_rate(self) -> float: ...

    @property
    def shaft_angle(self) -> float: ...


class DeckShaft:
    """The shaft of a deck's bed: a torque is the voltage that its armature would need at the rate that a tick begins
    with, and the current that its load motor would take. kt, kt_load N m/A;  resistance ohm"""

    def __init__(self, plant: DeckPlant, *, kt: float, resistance: float, kt_load: float) -> None:
        self._plant, self._kt, self._resistance, self._kt_load = plant, kt, resistance, kt_load
        self.period = plant.period
        plant.start(0.0, 0.0, 0.0)
        self.angle, self.rate = plant.shaft_angle, plant.shaft_rate

    def step(self, drive: Output, load: Output) -> None:
        back = self._kt * self.rate
        volts = {
            "off": back,
            "short": 0.0,
            "torque": back + self._resistance * drive.value / self._kt,
        }
        amperes = load.value / self._kt_load if load.kind == "torque" else 0.0
        self._plant.tick(volts[drive.kind], amperes)
        self.angle, self.rate = self._plant.shaft_angle, self._plant.shaft_rate
