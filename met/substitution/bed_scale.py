"""The scales of a bed whose motor differs in size from the joint's: factors of torque, rate and voltage.

    a number of the joint's motor = its scale x the same number of the bed's

Time is that of the clock on both sides. Torque, rate and voltage are free; all others follow, for J w' = tau and
tau w = V i hold on both sides:

    inertia, viscous friction   torque/rate             current      torque rate/voltage
    torque constant, back-EMF   voltage/rate            resistance   voltage^2/(torque rate)

A bed that is not scaled has 1 for all of them. Law, observer and arm use the joint's size; commands and readings on the
wire, and the bed's parameters in the deck, are of the bed's size.
"""

from __future__ import annotations

from collections.abc import Mapping

from met.frozen import frozen
from met.parameter import Parameter
from met.trace import Real

PARAMETERS = (
    Parameter(
        name="torque", default=1.0, above=0.0, doc="torque of the joint's motor divided by that of the bed's motor"
    ),
    Parameter(name="rate", default=1.0, above=0.0, doc="rate of the joint's motor divided by that of the bed's motor"),
    Parameter(
        name="voltage", default=1.0, above=0.0, doc="voltage on the joint's motor divided by that on the bed's motor"
    ),
)
"""The scales that a deck may write; their paths are `JOINT.bed.scale.NAME`."""

POWERS: Mapping[str, tuple[int, int, int]] = {
    "N*m": (1, 0, 0),
    "rad/s": (0, 1, 0),
    "rad": (0, 1, 0),
    "V": (0, 0, 1),
    "A": (1, 1, -1),
    "kg*m^2": (1, -1, 0),
    "N*m*s/rad": (1, -1, 0),
    "N*m/A": (0, -1, 1),
    "V*s/rad": (0, -1, 1),
    "V/rad": (0, -1, 1),
    "ohm": (-1, -1, 2),
    "s": (0, 0, 0),
    "Hz": (0, 0, 0),
    "1": (0, 0, 0),
}
"""The scale of a quantity by its unit: powers of the scales of torque, rate and voltage."""


@frozen
class BedScale:
    """The scales of one bed: torque, rate and voltage of the joint's motor over those of the bed's."""

    torque: Real = 1.0
    rate: Real = 1.0
    voltage: Real = 1.0

    @property
    def inertia(self) -> Real:
        """The scale of inertia, and of viscous friction."""
        return self.torque / self.rate

    def of(self, unit: str) -> Real:
        """The scale of a quantity with this unit, one of `POWERS`. Raises KeyError."""
        above: Real = 1.0
        below: Real = 1.0
        for scale, power in zip((self.torque, self.rate, self.voltage), POWERS[unit], strict=True):
            for _ in range(abs(power)):
                above, below = (above * scale, below) if power > 0 else (above, below * scale)
        return above / below
