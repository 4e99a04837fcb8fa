"""Velocity servo: a drive whose torque follows the rate error, with a limit and a lag of the first order.

    wanted = clip(gain (qd_cmd - qd), +-limit)      at every stage; qd_cmd is held between ticks
    d(torque)/dt = (wanted - torque)/lag

Not a motor: there is neither back-EMF nor friction.
"""

from __future__ import annotations

from typing import Any

from met.parameter import Memory, Parameter, Signal, State
from met.servos import Servo
from met.servos.servo import Control, Drive, JointMotion, Seen
from met.trace import Real, clip, maximum, sqrt


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The servo's computer: it hands the command on."""
    return Control({"qd_cmd": seen.setpoint.value})


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """The drive: its torque is a state, so the engine integrates it with the arm."""
    wanted = clip(p.gain * (held.qd_cmd - joint.qd), -p.limit, p.limit)
    return Drive(
        torque=states.torque,
        rotor=p.rotor,
        slopes={"torque": (wanted - states.torque) / p.lag},
        signals={"wanted": wanted},
    )


def fastest(p: Any) -> Real:
    """The roots of lag J x^2 + J x + gain = 0 are no larger than this in size, for any inertia J >= rotor, 1/s."""
    return maximum(1.0 / p.lag, sqrt(p.gain / (p.lag * p.rotor)))


SERVO = Servo(
    name="velocity_servo",
    doc=__doc__,
    commands=("rate",),
    parameters=(
        Parameter(name="gain", unit="effort*s/joint", above=0.0, doc="torque per rate error"),
        Parameter(name="limit", unit="effort", above=0.0, doc="largest torque"),
        Parameter(name="lag", unit="s", default=0.01, above=0.0, doc="time constant of the torque"),
        Parameter(name="rotor", unit="effort*s^2/joint", above=0.0, doc="inertia of the drive, seen at the joint"),
    ),
    outputs=(Memory(name="qd_cmd", unit="joint/s", doc="commanded rate"),),
    states=(State(name="torque", unit="effort", doc="torque of the drive"),),
    signals=(Signal(name="wanted", unit="effort", doc="torque that the drive goes to"),),
    control=control,
    drive=drive,
    fastest=fastest,
)
