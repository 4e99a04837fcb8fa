"""Stops at the ends of a joint's range: a spring on each side, which the joint runs into and which takes energy from
it.

With d the depth of the joint in a stop, and d' the rate at which it goes deeper,

    torque = -stiffness d max(0, 1 + dissipation d')        back from the stop, where d > 0; else none

the law of Hunt and Crossley (1975) with a linear spring. A stop never pulls. Its force begins at zero when the joint
meets it, whatever the rate, so an integrator of order 2 keeps its order over contacts; one of order 4 has order 2. A
spring with a damper beside it would begin with a jump, and pull when the joint leaves.

A joint that meets the stop at the rate v, with nothing else acting on it, leaves it at the rate v' with

    a v - ln(1 + a v) = -a v' - ln(1 - a v'),     a the dissipation

for any stiffness and inertia: v' = v (1 - 2/3 a v) if a v is small, and always below 1/a. The step should be short
compared with sqrt(inertia/stiffness). The stop acts between the link and its parent; the servo does not know of it.
"""

from __future__ import annotations

import math
from typing import Any

from met.environments.environment import Environment, Loads, World
from met.parameter import Limit, Parameter, Signal
from met.trace import Real, maximum, where


def loads(p: Any, world: World) -> Loads:
    return Loads(torques={p.joint: show(p, world)["tau"]})


def show(p: Any, world: World) -> dict[str, Real]:
    q, qd = world.q(p.joint), world.qd(p.joint)
    return {"tau": _push(p, p.lower - q, -qd) - _push(p, q - p.upper, qd)}


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why these numbers make the model do nothing, with the parameters that say so."""
    if math.isinf(p.lower) and math.isinf(p.upper):
        return ("lower", "upper"), "it has neither a lower nor an upper end"
    if p.stiffness == 0.0:
        return ("stiffness",), "it has no stiffness"
    return None


def _push(p: Any, beyond: Real, deeper: Real) -> Real:
    """The stop's push on the joint, N m (N), from how far the joint is beyond it, and how fast it goes further."""
    inside = beyond <= 0.0  # also where there is no stop, infinitely far away
    return where(inside, 0.0, p.stiffness * where(inside, 0.0, beyond) * maximum(0.0, 1.0 + p.dissipation * deeper))


ENVIRONMENT = Environment(
    name="joint_stop",
    doc=__doc__,
    parameters=(
        Parameter(name="joint", shape="word", names="joint", doc="joint whose range the stops limit"),
        Parameter(
            name="lower",
            unit="joint",
            default=-math.inf,
            less_than="upper",
            doc="position of the lower stop; by default there is none",
        ),
        Parameter(
            name="upper", unit="joint", default=math.inf, doc="position of the upper stop; by default there is none"
        ),
        Parameter(
            name="stiffness",
            unit="effort/joint",
            at_least=0.0,
            doc="stiffness of the stops: torque per displacement into a stop",
        ),
        Parameter(
            name="dissipation",
            unit="s/joint",
            default=0.0,
            at_least=0.0,
            doc="share by which the torque of a stop is larger per unit of the rate of penetration; 0: no energy is "
            "lost",
        ),
    ),
    loads=loads,
    springs=("joint", "stiffness"),
    idle=idle,
    limits=(
        Limit(parameter="lower", reached=lambda p, world: world.q(p.joint) < p.lower),
        Limit(parameter="upper", reached=lambda p, world: world.q(p.joint) > p.upper),
    ),
    initial_range=("lower", "upper"),
    signals=(Signal(name="tau", unit="effort", doc="torque of the stops on the joint; force on a prismatic one"),),
    show=show,
)
