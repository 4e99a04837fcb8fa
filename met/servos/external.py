"""External drive: the joint gets the torque of its command, and nothing else.

    tau = value

The value is taken at the servo's ticks and held, or at every stage if the servo is continuous. It is for a drive and a
control law that another program computes: `met compile -o FILE.fmu` makes an input of a constant command that a sweep
varies. `met run` alone has no such program, so a command must be given, such as `torque(0 N*m)`.

This is no motor: the torque has no limit, and follows the command at once.
"""

from __future__ import annotations

from typing import Any

from met.parameter import Memory, Parameter
from met.servos.servo import Control, Drive, JointMotion, Seen, Servo


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The servo's computer: it passes the command on."""
    return Control({"torque": seen.setpoint.value})


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    return Drive(torque=held.torque, rotor=p.rotor)


SERVO = Servo(
    name="external",
    doc=__doc__,
    commands=("torque",),
    parameters=(
        Parameter(
            name="rotor",
            unit="effort*s^2/joint",
            default=0.0,
            at_least=0.0,
            doc="inertia of the drive seen at the joint",
        ),
    ),
    outputs=(Memory(name="torque", unit="effort", doc="torque on the joint"),),
    control=control,
    drive=drive,
)
