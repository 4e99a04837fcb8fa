"""Contact of a sphere, or a point, on one link with a plane or a sphere on another, or on the ground: it presses the
two apart, takes energy, and rubs.

With d the depth of one in the other, d' the rate at which it grows, and v the velocity with which the link slides on
the other, the link feels

    N = k d^n max(0, 1 + dissipation d')        along the normal, where d > 0; else nothing
    F = -friction N v/sqrt(v^2 + slip^2)        across it

and the other one the opposite, at the same point, in the middle between the two surfaces. N is the law of Hunt and
Crossley (1975), which never pulls. With `law = linear`, n is 1 and k the stiffness. With `law = hertz`, n is 3/2 and k
is 4/3 modulus sqrt(R), with the modulus of both materials, 1/modulus = (1 - nu1^2)/E1 + (1 - nu2^2)/E2, and R the
radius, or for two spheres 1/R = 1/radius + 1/to_radius.

Where nothing slides there is no friction, so it holds nothing: a body on a slope creeps, at the rate
slip r/sqrt(1 - r^2), with r the slope over `friction`. The plane has no edges, and is solid to any depth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.environments.environment import Environment, Loads, Touch, World
from met.parameter import WORLD, ZEROS, Parameter, Signal
from met.trace import Real, maximum, sqrt, where
from met.vectors import add, cross, dot, scale, sub

HERTZ = 2.943275
"""The duration of a contact by Hertz's law without losses, over the greatest depth and times the rate at which the
bodies meet. It is 4/5 B(2/5, 1/2)."""


def loads(p: Any, world: World) -> Loads:
    """The force with which the two bodies press and rub on each other, N in the world, on both links."""
    touching = touch(p, world)
    press = _press(p, touching)
    force = scale(press, touching.normal)
    sliding = add(touching.moving, scale(touching.rate, touching.normal))
    rub = p.friction * press / sqrt(dot(sliding, sliding) + p.slip * p.slip)
    return Loads(forces=touching.forces(p, sub(force, scale(rub, sliding))))


def show(p: Any, world: World) -> Mapping[str, Any]:
    touching = touch(p, world)
    return {"depth": touching.depth, "normal": _press(p, touching), "force": loads(p, world).forces[0].force}


def touch(p: Any, world: World) -> Touch:
    """The place at which two bodies touch, or would, and their motion there: normal, depth (m), approach (m/s), in the
    world."""
    way = sub(world.position(p.link, p.at), world.position(p.to, p.to_at))
    if p.surface == "plane":
        normal = world.to_world(p.to, scale(1.0 / sqrt(dot(p.normal, p.normal)), p.normal))
        depth = p.radius - dot(normal, way)
    else:
        square = dot(way, way)
        apart = sqrt(where(square == 0.0, 1.0, square))
        normal, depth = scale(1.0 / apart, way), p.radius + p.to_radius - apart
    arm = scale(0.5 * depth - p.radius, normal)
    other = add(way, arm)
    moving = sub(
        add(world.velocity(p.link, p.at), cross(world.rate(p.link), arm)),
        add(world.velocity(p.to, p.to_at), cross(world.rate(p.to), other)),
    )
    return Touch(normal, depth, -dot(normal, moving), moving, arm, other)


def lasts(p: Any, mass: float, rate: float) -> float:
    """The duration of a contact that takes no energy, s, of bodies of this reduced mass, kg, that meet at this rate,
    m/s."""
    if p.law == "linear":
        return math.pi * math.sqrt(mass / p.stiffness)
    depth = (15.0 * mass * rate * rate / (16.0 * p.modulus * math.sqrt(_radius(p)))) ** 0.4
    return HERTZ * depth / rate


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why these numbers make the model do nothing, with the parameters that say so."""
    if (p.stiffness if p.law == "linear" else p.modulus) == 0.0:
        return ("stiffness", "modulus"), "it has no stiffness"
    if p.law == "hertz" and _radius(p) == 0.0:
        return ("radius", "to_radius"), "it has no radius, and so no stiffness by Hertz's law"
    if p.link == p.to:
        return ("to",), f"both bodies are fixed to link `{p.link}`"
    return None


def _press(p: Any, touching: Touch) -> Real:
    """The size of the force that presses the two bodies apart where they touch, N; 0 where they do not."""
    inside = touching.depth > 0.0
    depth = where(inside, touching.depth, 0.0)
    if p.law == "linear":
        size = p.stiffness * depth
    else:  # the root is not taken at 0, where it has no slope
        size = 4.0 / 3.0 * p.modulus * depth * sqrt(where(inside, _radius(p) * touching.depth, 1.0))
    return where(inside, size * maximum(0.0, 1.0 + p.dissipation * touching.rate), 0.0)


def _radius(p: Any) -> Real:
    """The radius R of the contact, m: of a sphere on a plane the sphere's, of two spheres their product over their
    sum."""
    if p.surface == "plane":
        radius: Real = p.radius
        return radius
    both = p.radius + p.to_radius
    return p.radius * p.to_radius / where(both == 0.0, 1.0, both)


ENVIRONMENT = Environment(
    name="contact",
    doc=__doc__,
    parameters=(
        Parameter(name="link", shape="word", names="link", doc="link that the sphere is on"),
        Parameter(
            name="at", unit="m", shape="vector", default=ZEROS, doc="middle of the sphere, in the frame of the link"
        ),
        Parameter(name="radius", unit="m", default=0.0, at_least=0.0, doc="radius of the sphere; 0: it is a point"),
        Parameter(
            name="to",
            shape="word",
            names="link",
            words=(WORLD,),
            default=WORLD,
            doc="link that it touches, or `world`: the ground",
        ),
        Parameter(
            name="surface",
            shape="word",
            words=("plane", "sphere"),
            default="plane",
            doc="what it touches there: a `plane`, solid on the side from which the normal comes, or a `sphere`",
        ),
        Parameter(
            name="to_at",
            unit="m",
            shape="vector",
            default=ZEROS,
            doc="a point of the plane, or the middle of the other sphere, in the frame of `to`",
        ),
        Parameter(
            name="normal",
            shape="vector",
            direction=True,
            only=("surface", ("plane",)),
            doc="normal of the plane, out of what is solid, in the axes of `to`",
        ),
        Parameter(
            name="to_radius", unit="m", at_least=0.0, only=("surface", ("sphere",)), doc="radius of the other sphere"
        ),
        Parameter(
            name="law",
            shape="word",
            words=("linear", "hertz"),
            default="linear",
            doc="how the force grows: with the depth, or with its power 3/2, as between elastic spheres",
        ),
        Parameter(name="stiffness", unit="N/m", at_least=0.0, only=("law", ("linear",)), doc="force per depth"),
        Parameter(
            name="modulus",
            unit="Pa",
            at_least=0.0,
            only=("law", ("hertz",)),
            doc="modulus of both materials together: a half of E/(1 - nu^2) if they are the same",
        ),
        Parameter(
            name="dissipation",
            unit="s/m",
            default=0.0,
            at_least=0.0,
            doc="share by which the force is larger per rate at which the depth grows; 0: no energy is lost",
        ),
        Parameter(
            name="friction",
            default=0.0,
            at_least=0.0,
            doc="coefficient of friction, of a body that slides much faster than `slip`",
        ),
        Parameter(
            name="slip",
            unit="m/s",
            default=0.01,
            above=0.0,
            doc="velocity of sliding at which friction has 0.71 of its full size; what it holds creeps slower",
        ),
    ),
    loads=loads,
    springs=("link", "stiffness", "modulus"),
    touch=touch,
    lasts=lasts,
    idle=idle,
    pushed_links=lambda p: ("link", "to"),
    holds=lambda p: ("link", "to"),
    may_be_load=True,
    signals=(
        Signal(name="depth", unit="m", doc="depth of one body in the other; below 0, the gap between them"),
        Signal(name="normal", unit="N", doc="force along the normal that presses the bodies apart"),
        Signal(name="force", unit="N", doc="force on `link`, with friction", axes="world axes"),
    ),
    show=show,
)
