"""The shaft that two played drives turn: an inertia with friction."""

from __future__ import annotations

import math
from typing import Protocol

from met.frozen import frozen


@frozen
class Output:
    """The work of a drive's bridge: `off`, a `torque` (N m), or `short`, its windings shorted."""

    kind: str = "off"
    value: float = 0.0


OFF = Output()


class PlayedShaft(Protocol):
    """A shaft that is stepped by hand. period s;  angle rad, rate rad/s"""

    period: float
    angle: float
    rate: float

    def step(self, drive: Output, load: Output) -> None:
        """Advance by a period with the torques of the two drives."""


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
