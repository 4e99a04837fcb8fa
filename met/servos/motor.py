"""A direct-current motor behind a rigid gearbox, by its data sheet, seen from its shaft."""

from __future__ import annotations

from met.frozen import frozen
from met.parameter import Parameter
from met.trace import Real, clip

TABLE_1 = "Hill, Hopping, Price 1989, table 1"

RATIO = Parameter(
    name="ratio",
    unit="rad/joint",
    above=0.0,
    if_negative="the joint moves the same, and the motor's rate, torque and voltage have the other sign",
    source=TABLE_1,
    doc="gear ratio N: angle of the motor divided by that of the joint",
)
SHAFT = (
    Parameter(name="j_m", unit="kg*m^2", above=0.0, source=TABLE_1, doc="inertia J_m of the motor's shaft"),
    Parameter(
        name="f_c",
        unit="N*m",
        default=0.0,
        at_least=0.0,
        source=TABLE_1,
        doc="Coulomb friction F_c on the motor's shaft",
    ),
    Parameter(
        name="f_v",
        unit="N*m*s/rad",
        default=0.0,
        at_least=0.0,
        source=TABLE_1,
        doc="viscous friction F_v on the motor's shaft: torque per shaft rate",
    ),
)
ARMATURE = (
    Parameter(name="resistance", unit="ohm", above=0.0, source=TABLE_1, doc="armature resistance R"),
    Parameter(
        name="kt",
        unit="N*m/A",
        above=0.0,
        source=TABLE_1,
        doc="torque constant Kt, which is also the back-EMF constant in V s/rad",
    ),
)
TAU_MAX = Parameter(
    name="tau_max", unit="N*m", above=0.0, source=TABLE_1, doc="largest torque of the motor, before friction"
)
"""Limit of the motor's torque; with `RATIO`, `SHAFT` and `ARMATURE` the parameters of a servo with a motor."""


@frozen
class Motor:
    """A motor as its servo's parameters describe it; shaft side.

    ratio       turns of the shaft a turn of the joint N (rad/m on a prismatic joint)
    kt          torque constant, and back-EMF constant (N m/A, V s/rad);  resistance: of the armature, ohm
    tau_max     largest torque, before friction, N m
    inertia     of the shaft J_m, kg m^2
    f_c, f_v    Coulomb friction N m, viscous friction N m s/rad
    """

    ratio: Real
    kt: Real
    resistance: Real
    tau_max: Real
    inertia: Real
    f_c: Real
    f_v: Real

    @property
    def damping(self) -> Real:
        """The torque that brakes the shaft for each unit of its rate, N m s/rad."""
        return damping(self.kt, self.resistance, self.f_v)


@frozen
class RateLoop:
    """The PI loop on a motor's rate that sets its voltage, from its servo's parameters; shaft side.

    kp  V s/rad;  ki: V/rad;  v_max: largest voltage, V
    """

    kp: Real
    ki: Real
    v_max: Real


def damping(kt: Real, resistance: Real, f_v: Real) -> Real:
    """Damping by back-EMF and viscous friction, for each unit of the shaft's rate, N m s/rad."""
    return kt * kt / resistance + f_v


def torque(kt: Real, resistance: Real, tau_max: Real, voltage: Real, w: Real) -> Real:
    """Torque of a motor at a voltage (V) and a shaft rate w (rad/s), before friction, N m."""
    # kt / R together: one number where no case varies them, and no division at each stage.
    return clip(kt / resistance * (voltage - kt * w), -tau_max, tau_max)
