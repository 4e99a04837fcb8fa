"""Motor substitution: one joint's motor is real, on a motor bed, or the emulated bed (docs/physics.md).

Laws and beds, one a file. To add one: write its file, add it to `LAWS` or `BEDS`. Everything here is on the motor's
side of the gearbox: w is the shaft's rate, torques are the shaft's.
"""

from met.substitution import (
    bare,
    emulated,
    measured_acceleration,
    rate_drive,
    torque_balance,
    torque_balance_observer,
    torque_drive,
    velocity_tracking,
)
from met.substitution.bed import BedModel
from met.substitution.law import Law

LAWS: tuple[Law, ...] = (
    velocity_tracking.LAW,
    torque_balance_observer.LAW,
    torque_balance.LAW,
    bare.LAW,
    measured_acceleration.LAW,
)
BEDS: tuple[BedModel, ...] = (emulated.BED, torque_drive.BED, rate_drive.BED)
