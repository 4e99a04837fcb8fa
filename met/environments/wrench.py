"""A constant force and moment on a link, in world axes or the link's, for a time or always.

The force acts at `point` of the link, which moves along with it. `axes = link`: force and moment turn with the link
too. It acts at times t with from <= t < until; where `until` is the earlier, never. A step of the dynamics that lies
within this window in part sees the force times the share that does, at all of its stages: so the impulse is right, and
a window that begins and ends with steps is met exactly.
"""

from __future__ import annotations

import math
from typing import Any

from met.environments.environment import Environment, Force, Loads, Vector, World
from met.parameter import Parameter
from met.trace import Real, clip, maximum


def loads(p: Any, world: World) -> Loads:
    share = maximum(0.0, _passed(world, p.until) - _passed(world, getattr(p, "from")))

    def acting(vector: Vector) -> Vector:
        x, y, z = world.to_world(p.link, vector) if p.axes == "link" else vector
        return share * x, share * y, share * z

    return Loads(forces=(Force(p.link, force=acting(p.force), moment=acting(p.moment), point=p.point),))


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """Why these numbers make it nothing in a run of this length, with the parameters that say so."""
    begins = getattr(p, "from")
    if not any((*p.force, *p.moment)):
        return ("force", "moment"), "it has neither force nor moment"
    if begins >= p.until:
        return ("until", "from"), f"it would begin at {begins:g} s and end at {p.until:g} s"
    if begins >= duration:
        return ("from",), f"it would begin at {begins:g} s, and the run ends at {duration:g} s"
    if p.until <= 0.0:
        return ("until",), f"it would end at {p.until:g} s, and the run begins at 0 s"
    return None


def _passed(world: World, time: Real) -> Real:
    """The share of the step that lies before this time."""
    return clip((time - world.begin) / world.step, 0.0, 1.0)


ZERO = (0.0, 0.0, 0.0)

ENVIRONMENT = Environment(
    name="wrench",
    doc=__doc__,
    parameters=(
        Parameter(name="link", shape="word", doc="link that it acts on"),
        Parameter(name="force", unit="N", shape="vector", default=ZERO, doc="force"),
        Parameter(name="moment", unit="N*m", shape="vector", default=ZERO, doc="moment, besides that of the force"),
        Parameter(name="point", unit="m", shape="vector", default=ZERO, doc="where the force acts, link frame"),
        Parameter(
            name="axes", shape="word", words=("world", "link"), default="world",
            doc="axes of force and moment: the world's, or the link's, which turn with it",
        ),
        Parameter(name="from", unit="s", default=0.0, doc="time at which it begins"),
        Parameter(name="until", unit="s", default=math.inf, doc="time at which it ends; never unless written"),
    ),
    loads=loads,
    idle=idle,
    pushes="link",
)
