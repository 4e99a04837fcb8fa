"""A driver for `--port flywheel:INERTIA`: both motors turn a flywheel of so many kg m^2, and nothing else.

A driver is a `BedDriver` (hw/bed.py). This one takes `EmulatedBed`, which has the states, limits and counts of a bed in
this process, and gives it a plant of its own; a bed with a line takes `WireBed` and gives it a line.
"""

from __future__ import annotations

import math

from hw.bed import Limits, Scales
from hw.beds.emulated import EmulatedBed
from hw.ports import Opening, PortKind
from met.diagnostic import Problem, error

KT, RESISTANCE, KT_LOAD = 0.061, 2.05, 0.072
"""Constants of the motors: drive, N m/A and ohm; load, N m/A."""

SCALES = Scales(voltage=0.01, current=0.0015, rate=0.2, angle=1e-4, drive_current=1e-3, acceleration=1e-3)
"""A count of the converters: V, A, rad/s, rad, A, rad/s^2."""

LIMITS = Limits(voltage=60.0, current=3.0, rate=1000.0, arming_rate=5.0, voltage_slew=6e4, current_slew=6e3, heat=9.0)


class Flywheel:
    """The plant: inertia in kg m^2, stepped by `period` s."""

    def __init__(self, inertia: float, period: float) -> None:
        self.inertia, self.period = inertia, period
        self.rate = self.shaft_angle = 0.0

    def start(self, rate: float, seed: float, repeat: float) -> float:
        self.rate, self.shaft_angle = rate, 0.0
        return self.rate

    def tick(self, voltage: float, current: float) -> float:
        torque = KT / RESISTANCE * (voltage - KT * self.rate) + KT_LOAD * current
        self.rate += self.period * torque / self.inertia
        self.shaft_angle += self.period * self.rate
        return self.rate


def opened(opening: Opening) -> EmulatedBed:
    """The driver of the bed at a port. Where nothing is to be exchanged the period is infinite: 1 ms then."""
    try:
        inertia = float(opening.port.address)
    except ValueError:
        inertia = 0.0
    if not 0.0 < inertia < math.inf:
        message = f"port `{opening.port.name}`: `{opening.port.address}` is no inertia"
        raise Problem(error("E400", message, help="write it in kg m^2: `--port flywheel:6e-5`"))
    period = opening.period if math.isfinite(opening.period) else 1e-3
    return EmulatedBed(Flywheel(inertia, period), SCALES, LIMITS, name="flywheel")


PORT = PortKind(
    scheme="flywheel",
    address="INERTIA",
    doc="A flywheel on both motors, in this process, in lock-step.",
    open=opened,
    lock_step=lambda name, requested: True,
)
