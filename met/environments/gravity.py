"""Uniform gravity: the same acceleration everywhere. `gravity = [0, 0, -9.81] m/s^2;` is short for it."""

from __future__ import annotations

from typing import Any

from met.environments.environment import Environment, Loads, World
from met.parameter import Parameter


def loads(p: Any, world: World) -> Loads:
    return Loads(gravity=p.g)


ENVIRONMENT = Environment(
    name="gravity",
    doc=__doc__,
    at_rest="weight",
    parameters=(Parameter(name="g", unit="m/s^2", shape="vector", doc="acceleration of free fall, in world axes"),),
    loads=loads,
    alone=lambda p: "gravity" if any(p.g) else "",
)
