"""A constant force and moment on a link, in the axes of the world or of the link, for a time or always.

The force acts at `point` of the link, which moves with the link. With `axes = link`, force and moment turn with the
link too. They act at times t with from <= t < until; if `until` is the earlier of the two, never. In a step of the
dynamics that is partly in this window, the same share of the force acts, at all of its stages: so the impulse is right,
and a window that begins and ends with steps is met exactly.
"""

from __future__ import annotations

from typing import Any

from met.environments.environment import WINDOW, Environment, Force, Loads, World, never, share
from met.parameter import ZEROS, Parameter
from met.vectors import Vector, scale


def loads(p: Any, world: World) -> Loads:
    """The force and moment on the link, N and N m in the world, for the share of the step in their window."""
    acting = share(world, getattr(p, "from"), p.until)

    def felt(vector: Vector) -> Vector:
        return scale(acting, world.to_world(p.link, vector) if p.axes == "link" else vector)

    return Loads(forces=(Force(p.link, force=felt(p.force), moment=felt(p.moment), point=p.point),))


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why these numbers make the model do nothing in a run of this length, with the parameters that say
    so."""
    if not any((*p.force, *p.moment)):
        return ("force", "moment"), "it has neither force nor moment"
    return never(getattr(p, "from"), p.until, duration)


ENVIRONMENT = Environment(
    name="wrench",
    doc=__doc__,
    parameters=(
        Parameter(name="link", shape="word", names="link", doc="link that force and moment act on"),
        Parameter(name="force", unit="N", shape="vector", default=ZEROS, doc="force"),
        Parameter(
            name="moment",
            unit="N*m",
            shape="vector",
            default=ZEROS,
            doc="moment on the link, in addition to the moment of the force",
        ),
        Parameter(
            name="point",
            unit="m",
            shape="vector",
            default=ZEROS,
            doc="point at which the force acts, in the link's frame",
        ),
        Parameter(
            name="axes",
            shape="word",
            words=("world", "link"),
            default="world",
            doc="axes of force and moment: those of the world, or those of the link, which turn with it",
        ),
        *WINDOW,
    ),
    loads=loads,
    idle=idle,
    pushed_links=lambda p: ("link",),
)
