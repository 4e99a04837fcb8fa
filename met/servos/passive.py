"""Passive joint: no motor and no command; damping, dry friction that sticks, a spring, and an inertia that moves with
the joint.

    tau = -damping qd - stiffness (q - rest) - s friction,  s in {0, +1, -1} (stuck, forward, backward)

With all parameters at zero it is a joint without a servo. How fast the joint can move depends on the inertia behind it,
so the model has no bound of its own on that, and no warning tells of a spring or damper that is too stiff for the step.
"""

from __future__ import annotations

from typing import Any

from met.parameter import Parameter
from met.servos.servo import Drive, JointMotion, Servo


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """The torques of the damper, the spring and friction."""
    return Drive(
        torque=-p.damping * joint.qd - p.stiffness * (joint.q - p.rest),
        dry=p.friction,
        rotor=p.rotor,
        potential=0.5 * p.stiffness * (joint.q - p.rest) * (joint.q - p.rest),
    )


SERVO = Servo(
    name="passive",
    doc=__doc__,
    parameters=(
        Parameter(
            name="damping", unit="effort*s/joint", default=0.0, at_least=0.0, doc="damping: torque per joint rate"
        ),
        Parameter(
            name="friction",
            unit="effort",
            default=0.0,
            at_least=0.0,
            doc="dry friction, under which the joint can stick",
        ),
        Parameter(
            name="stiffness",
            unit="effort/joint",
            default=0.0,
            at_least=0.0,
            doc="stiffness of the spring: torque per displacement from `rest`",
        ),
        Parameter(name="rest", unit="joint", default=0.0, doc="joint position at which the spring has no torque"),
        Parameter(
            name="rotor",
            unit="effort*s^2/joint",
            default=0.0,
            at_least=0.0,
            doc="inertia that moves with the joint and is not part of the arm",
        ),
    ),
    drive=drive,
)
