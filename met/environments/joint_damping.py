"""Viscous damping at every joint, as by grease outside the servo: torque = -damping qd, force = -sliding qd."""

from __future__ import annotations

from typing import Any

from met.environments.environment import Environment, Loads, World
from met.parameter import Parameter


def loads(p: Any, world: World) -> Loads:
    rates = {joint: p.sliding if world.slides(joint) else p.damping for joint in world.joints}
    return Loads(torques={joint: -rate * world.qd(joint) for joint, rate in rates.items()})


ENVIRONMENT = Environment(
    name="joint_damping",
    doc=__doc__,
    at_rest="nothing",
    parameters=(
        Parameter(
            name="damping",
            unit="N*m*s/rad",
            default=0.0,
            at_least=0.0,
            joints="revolute",
            doc="torque per joint rate, the same for all revolute joints",
        ),
        Parameter(
            name="sliding",
            unit="N*s/m",
            default=0.0,
            at_least=0.0,
            joints="prismatic",
            doc="force per joint rate, the same for all prismatic joints",
        ),
    ),
    loads=loads,
)
