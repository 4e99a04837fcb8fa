"""A bushing: a spring and damper with six degrees of freedom between a frame on a link and a frame on another, or on
the ground.

With x the origin of the link's frame in the other frame, phi its rotation vector there (axis times angle) and w its
angular velocity relative to it, all along the axes of the other frame,

    F = -stiffness x - damping x'                                  on the link, at the origin of its frame
    M = -(turning phi + phi x (turning phi)/2 + g phi x (phi x (turning phi))) - turning_damping w

where g = (1 - a/tan(a))/(4 a^2), with a half of the angle. The opposite force and moment act on the other link, along
the same line. Each vector holds three numbers, along or about the axes of the other frame.

M follows from the energy phi' turning phi/2 at any angle below half a turn, so a motion that returns to its start gains
no energy; for small angles M is -turning phi. At half a turn the rotation vector changes its sign, and M jumps: motions
that may reach this angle need another model. The model is not made for rubber whose stiffness depends on load or
frequency.

The bushing acts at times t with from <= t < until. With a `ramp`, its force and moment grow from nothing at `from` to
their full size, in proportion to the time, as those of a latch do that closes:

    s = clip((t - from)/ramp, 0, 1),     s F and s M in the place of F and M

A stiffness that grows while the bushing is stretched puts energy into the arm. What closes the latch does this work,
x' stiffness x/2 for each unit of s, and likewise of phi. At `until` all of it ends at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from met.environments.environment import WINDOW, Environment, Force, Loads, World, never, passed, share
from met.parameter import WORLD, ZEROS, Parameter, Signal
from met.trace import Real, clip, cos, sin, sqrt, where
from met.vectors import (
    Matrix,
    Vector,
    add,
    constant,
    cross,
    dot,
    product,
    rotation_rpy,
    rotation_vector,
    scale,
    sub,
    transposed,
    turn_vector,
    turn_vector_back,
)


def loads(p: Any, world: World) -> Loads:
    """Force and moment of the bushing on both links, N and N m in the world."""
    other, apart, along, about = _felt(p, world)
    force, moment = turn_vector(other, along), turn_vector(other, about)
    back = scale(-1.0, add(moment, cross(apart, force)))
    return Loads(forces=(Force(p.link, force, moment, p.at), Force(p.to, scale(-1.0, force), back, p.to_at)))


def show(p: Any, world: World) -> Mapping[str, Vector]:
    _, _, along, about = _felt(p, world)
    return {"force": along, "moment": about}


def _felt(p: Any, world: World) -> tuple[Matrix, Vector, Vector, Vector]:
    """Axes of the frame on `to`, in the world; the vector from its origin to that of the frame on `link`, m, world
    axes; force and moment on `link`, N and N m, along the axes of the frame on `to`."""
    own = product(world.orientation(p.link), rotation_rpy(*p.rpy))
    other = product(world.orientation(p.to), rotation_rpy(*p.to_rpy))
    apart = sub(world.position(p.link, p.at), world.position(p.to, p.to_at))
    moving = sub(world.velocity(p.link, p.at), add(world.velocity(p.to, p.to_at), cross(world.rate(p.to), apart)))
    turning = sub(world.rate(p.link), world.rate(p.to))

    x, v, w = (turn_vector_back(other, vector) for vector in (apart, moving, turning))
    force = _minus(_by_component(p.stiffness, x), _by_component(p.damping, v))
    moment = sub(restoring(p.turning, product(transposed(other), own)), _by_component(p.turning_damping, w))
    strength = _strength(p, world)
    return other, apart, scale(strength, force), scale(strength, moment)


def _strength(p: Any, world: World) -> Real:
    """s at a stage, from 0 to 1, with the share of the step that lies in the window."""
    begins, until, ramp = getattr(p, "from"), p.until, p.ramp
    if constant(begins) and constant(until) and constant(ramp) and begins <= 0.0 and math.isinf(until) and ramp == 0.0:
        return 1.0
    closes = ramp > 0.0
    closed = clip((world.time - begins) / where(closes, ramp, 1.0), 0.0, 1.0)
    return where(closes, closed * passed(world, until), share(world, begins, until))


def restoring(stiffness: Vector, R: Matrix) -> Vector:
    """The moment M of a frame turned by R, without damping, in the axes that it is turned against, N m."""
    phi = rotation_vector(R)
    felt = _by_component(stiffness, phi)
    once = cross(phi, felt)
    twice = scale(_bending(dot(phi, phi)), cross(phi, once))
    return scale(-1.0, add(felt, add(scale(0.5, once), twice)))


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why these numbers make the model do nothing, with the parameters that say so."""
    if not any((*p.stiffness, *p.damping, *p.turning, *p.turning_damping)):
        return ("stiffness", "turning", "damping", "turning_damping"), "it has neither stiffness nor damping"
    if p.link == p.to:
        return ("to",), f"both its frames are fixed to link `{p.link}`"
    return never(getattr(p, "from"), p.until, duration)


def _bending(square: Real) -> Real:
    """g of the square of the angle, (1 - a cot a)/(4 a^2) with a half the angle: by its series where the formula
    cancels."""
    small = square < 0.01
    a = 0.5 * sqrt(where(small, 1.0, square))
    exact = (1.0 - a * cos(a) / sin(a)) / (4.0 * a * a)
    # the next term is square^4/47900160, 2e-16 at the most
    series = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square * (1.0 / 1209600.0)))
    return where(small, series, exact)


def _by_component(factors: Vector, vector: Vector) -> Vector:
    return (factors[0] * vector[0], factors[1] * vector[1], factors[2] * vector[2])


def _minus(a: Vector, b: Vector) -> Vector:
    return (-a[0] - b[0], -a[1] - b[1], -a[2] - b[2])


def _three(name: str, unit: str, doc: str) -> Parameter:
    return Parameter(name=name, unit=unit, shape="vector", default=ZEROS, at_least=0.0, doc=doc)


AXES = "axes of the bushing's frame on `to`"

ENVIRONMENT = Environment(
    name="bushing",
    doc=__doc__,
    parameters=(
        Parameter(name="link", shape="word", names="link", doc="link on one side of the bushing"),
        Parameter(
            name="at",
            unit="m",
            shape="vector",
            default=ZEROS,
            doc="origin of the bushing's frame on that link, in the link's frame",
        ),
        Parameter(
            name="rpy",
            unit="rad",
            shape="vector",
            default=ZEROS,
            doc="rotation of the bushing's frame on `link`, about the link's fixed x, then y, then z axis",
        ),
        Parameter(
            name="to",
            shape="word",
            names="link",
            words=(WORLD,),
            default=WORLD,
            doc="link on the other side of the bushing, or `world`: the ground",
        ),
        Parameter(
            name="to_at",
            unit="m",
            shape="vector",
            default=ZEROS,
            doc="origin of the bushing's frame on `to`, in the frame of that link",
        ),
        Parameter(
            name="to_rpy",
            unit="rad",
            shape="vector",
            default=ZEROS,
            doc="rotation of the bushing's frame on `to`, about that link's fixed x, then y, then z axis; stiffness "
            "and damping are along its axes",
        ),
        _three("stiffness", "N/m", "force per displacement along each axis"),
        _three("damping", "N*s/m", "force per velocity along each axis"),
        _three("turning", "N*m/rad", "moment per small angle about each axis"),
        _three("turning_damping", "N*m*s/rad", "moment per angular velocity about each axis"),
        *(replace(parameter, timing=True) for parameter in WINDOW),
        Parameter(
            name="ramp",
            unit="s",
            default=0.0,
            at_least=0.0,
            timing=True,
            doc="time from `from` in which force and moment grow to their full size; 0: they act in full at once",
        ),
    ),
    loads=loads,
    idle=idle,
    pushed_links=lambda p: ("link", "to"),
    signals=(
        Signal(name="force", unit="N", doc="force of the bushing on `link`", axes=AXES),
        Signal(name="moment", unit="N*m", doc="moment of the bushing on `link`", axes=AXES),
    ),
    show=show,
    holds=lambda p: ("link", "to") if any((*p.stiffness, *p.turning)) else (),
)
