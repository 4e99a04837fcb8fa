"""A linear spring and damper between a point of a link and a point of another, or of the ground.

    T = stiffness (d - length) + damping d'

along the line between the points, with d their distance: T pulls the points towards each other, and pushes them apart
if it is below zero. `acts = pull` is a rope: no force while d <= length, and none that pushes. If both points are in
one place there is no line, and no force. The spring does not bend, and has no mass.
"""

from __future__ import annotations

from typing import Any

from met.environments.environment import Environment, Force, Loads, World
from met.parameter import WORLD, ZEROS, Parameter
from met.trace import maximum, sqrt, where
from met.vectors import dot, scale, sub


def loads(p: Any, world: World) -> Loads:
    """Pull of the spring and damper on both of its ends, N, in the world."""
    way = sub(world.position(p.to, p.to_point), world.position(p.link, p.point))
    apart = sqrt(dot(way, way))
    along = scale(1.0 / where(apart == 0.0, 1.0, apart), way)
    growing = dot(along, sub(world.velocity(p.to, p.to_point), world.velocity(p.link, p.point)))
    tension = p.stiffness * (apart - p.length) + p.damping * growing
    if p.acts == "pull":
        tension = where(apart <= p.length, 0.0, maximum(0.0, tension))
    pull = scale(tension, along)
    return Loads(forces=(Force(p.link, pull, point=p.point), Force(p.to, scale(-1.0, pull), point=p.to_point)))


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why these numbers make the model do nothing, with the parameters that say so."""
    if p.stiffness == 0.0 and p.damping == 0.0:
        return ("stiffness", "damping"), "it has neither stiffness nor damping"
    if p.link == p.to:
        return ("to",), f"both its points are fixed to link `{p.link}`"
    return None


ENVIRONMENT = Environment(
    name="spring",
    doc=__doc__,
    parameters=(
        Parameter(name="link", shape="word", names="link", doc="link at one end of the spring"),
        Parameter(
            name="point",
            unit="m",
            shape="vector",
            default=ZEROS,
            doc="attachment point of the spring on `link`, in the link's frame",
        ),
        Parameter(
            name="to",
            shape="word",
            names="link",
            words=(WORLD,),
            default=WORLD,
            doc="link at the other end of the spring, or `world`: the ground",
        ),
        Parameter(
            name="to_point",
            unit="m",
            shape="vector",
            default=ZEROS,
            doc="attachment point of the spring on `to`, in the frame of that link",
        ),
        Parameter(name="stiffness", unit="N/m", at_least=0.0, doc="stiffness: force per elongation"),
        Parameter(name="damping", unit="N*s/m", default=0.0, at_least=0.0, doc="damping: force per rate of elongation"),
        Parameter(name="length", unit="m", default=0.0, at_least=0.0, doc="length of the spring without load"),
        Parameter(
            name="acts",
            shape="word",
            words=("both", "pull"),
            default="both",
            doc="`both`: the spring pulls and pushes; `pull`: it only pulls, as a rope does",
        ),
    ),
    loads=loads,
    idle=idle,
    pushed_links=lambda p: ("link", "to"),
    holds=lambda p: ("link", "to") if p.stiffness else (),
    may_be_load=True,
)
