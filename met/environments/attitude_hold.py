"""Attitude hold: a moment on a link, by default the base, that turns it to an attitude and damps its rate.

    moment = clip(-stiffness e - damping w, +-limit), axis by axis, in the link's axes or the world's
    e = 2 sin(phi/2) n      the link is turned from the wanted attitude by phi about the axis n

For small angles e is the rotation vector phi n. It is largest at half a turn, where the direction of the way back
changes. The moment is external, like that of thrusters: momentum is not conserved. There is no integral, no dead band,
and no propellant.
"""

from __future__ import annotations

import math
from typing import Any

from met.environments.environment import Environment, Force, Loads, Vector, World
from met.parameter import Limit, Parameter
from met.trace import Real, absolute, clip, where
from met.vectors import composed, quaternion, quaternion_rpy


def loads(p: Any, world: World) -> Loads:
    x, y, z = (clip(wanted, -limit, limit) for wanted, limit in zip(_wanted(p, world), p.limit, strict=True))
    moment = (x, y, z) if p.axes == "world" else world.to_world(p.link, (x, y, z))
    return Loads(forces=(Force(p.link, moment=moment),))


def _wanted(p: Any, world: World) -> list[Real]:
    """The moment without its limit about x, y and z of `axes`, N m."""
    R, rate = world.orientation(p.link), world.rate(p.link)
    w, x, y, z = quaternion_rpy(*p.rpy)
    w, x, y, z = composed((w, -x, -y, -z), quaternion(R))
    short = where(w < 0.0, -2.0, 2.0)
    error: Vector = (short * x, short * y, short * z)  # along n, which is the same in the axes of both attitudes
    if p.axes == "world":
        error = world.to_world(p.link, error)
    else:
        rate = tuple(sum(R[i][j] * rate[i] for i in range(3)) for j in range(3))  # type: ignore[assignment]
    numbers = zip(p.stiffness, p.damping, error, rate, strict=True)
    return [-stiffness * e - damping * w for stiffness, damping, e, w in numbers]


def _limit(number: int) -> Limit:
    """The limit of the moment about one axis, number 0 to 2."""
    return Limit(
        parameter=f"limit.{'xyz'[number]}",
        reached=lambda p, world: absolute(_wanted(p, world)[number]) >= p.limit[number],
    )


def held(p: Any) -> str:
    """The attitude that the model holds: the axes along which it has a stiffness; damping alone holds none."""
    about = [axis for axis, stiffness in zip("xyz", p.stiffness, strict=True) if stiffness]
    if not about:
        return ""
    return f"the attitude of `{p.link}`" + (f" about {' and '.join(about)}" if len(about) < 3 else "")


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why these numbers make the model do nothing, with the parameters that say so."""
    if not any((*p.stiffness, *p.damping)):
        return ("stiffness", "damping"), "it has neither stiffness nor damping"
    if not any(p.limit):
        return ("limit",), "its moment is limited to nothing"
    return None


ZERO = (0.0, 0.0, 0.0)

ENVIRONMENT = Environment(
    name="attitude_hold",
    doc=__doc__,
    parameters=(
        Parameter(name="link", shape="word", names="link", default="base", doc="link whose attitude is held"),
        Parameter(
            name="rpy",
            unit="rad",
            shape="vector",
            default=ZERO,
            doc="wanted attitude: rotations about the world's fixed x, then y, then z axis",
        ),
        Parameter(
            name="stiffness",
            unit="N*m/rad",
            shape="vector",
            default=ZERO,
            at_least=0.0,
            doc="moment per radian of attitude error, about x, y and z",
        ),
        Parameter(
            name="damping",
            unit="N*m*s/rad",
            shape="vector",
            default=ZERO,
            at_least=0.0,
            doc="moment per rad/s of angular velocity, about x, y and z",
        ),
        Parameter(
            name="limit",
            unit="N*m",
            shape="vector",
            default=(math.inf, math.inf, math.inf),
            at_least=0.0,
            doc="largest moment about x, y and z; by default unlimited",
        ),
        Parameter(
            name="axes",
            shape="word",
            words=("link", "world"),
            default="link",
            doc="axes of stiffness, damping and limit: those of the link, as for thrusters, or those of the world",
        ),
    ),
    loads=loads,
    limits=tuple(map(_limit, range(3))),
    idle=idle,
    alone=held,
    pushed_links=lambda p: ("link",),
    holds=lambda p: ("link",) if any(p.stiffness) else (),
)
