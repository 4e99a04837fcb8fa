"""Viscous damping at every joint, as of grease outside the servo: torque = -damping qd."""

from __future__ import annotations

from typing import Any

from met.environments.environment import Environment, Loads, World
from met.parameter import Parameter


def loads(p: Any, world: World) -> Loads:
    return Loads(torques={joint: -p.damping * world.qd(joint) for joint in world.joints})


ENVIRONMENT = Environment(
    name="joint_damping",
    doc=__doc__,
    parameters=(
        Parameter(name="damping", unit="N*m*s/rad", at_least=0.0, doc="torque per joint rate, the same at all joints"),
    ),
    loads=loads,
)
