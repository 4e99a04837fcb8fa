"""A steady wind on one link: drag = 1/2 density area |u| u, with u the wind's velocity seen from a point of the link.

Not aerodynamics: the area does not turn with the link, and there is no lift.
"""

from __future__ import annotations

from typing import Any

from met.environments import Environment
from met.environments.environment import Force, Loads, World
from met.parameter import Parameter
from met.trace import sqrt


def loads(p: Any, world: World) -> Loads:
    moving = world.velocity(p.link, p.point)
    x, y, z = (wind - own for wind, own in zip(p.velocity, moving, strict=True))
    drag = 0.5 * p.density * p.area * sqrt(x * x + y * y + z * z)
    return Loads(forces=(Force(p.link, force=(drag * x, drag * y, drag * z), point=p.point),))


ENVIRONMENT = Environment(
    name="wind",
    doc=__doc__,
    parameters=(
        Parameter(name="link", shape="word", names="link", doc="link that the wind blows on"),
        Parameter(name="velocity", unit="m/s", shape="vector", doc="velocity of the wind, world axes"),
        Parameter(name="point", unit="m", shape="vector", default=(0.0, 0.0, 0.0), doc="where it acts, link frame"),
        Parameter(name="area", unit="m^2", at_least=0.0, doc="drag coefficient times the area that the wind meets"),
        Parameter(
            name="density",
            unit="kg/m^3",
            default=1.225,
            above=0.0,
            doc="density of the air",
            source="ISO 2533:1975, standard atmosphere at sea level",
        ),
    ),
    loads=loads,
)
