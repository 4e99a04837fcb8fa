"""A brake on a joint: dry friction that holds it, and slows it down where it moves, while the brake is on.

    torque = -s torque,  s in {0, +1, -1} (held, forward, backward)

Held means that the joint does not move at all, as long as what pulls at it is no more than `torque`. It adds to the
friction of the joint's servo. It acts at times t with from <= t < until; a step that lies in this window in part sees
the share of the torque that does.

On the joint's side: a brake on the motor's shaft holds N times its torque, but not against a gear that winds up. Not a
lock, which holds anything: see the servo `locked`.
"""

from __future__ import annotations

from typing import Any

from met.environments.environment import Environment, Loads, World
from met.environments.window import WINDOW, never, share
from met.parameter import Parameter


def loads(p: Any, world: World) -> Loads:
    return Loads(dry={p.joint: share(world, getattr(p, "from"), p.until) * p.torque})


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """Why these numbers make it nothing in a run of this length, with the parameters that say so."""
    if p.torque == 0.0:
        return ("torque",), "it has no torque"
    return never(getattr(p, "from"), p.until, duration)


ENVIRONMENT = Environment(
    name="brake",
    doc=__doc__,
    parameters=(
        Parameter(name="joint", shape="word", names="joint", doc="joint that the brake acts on"),
        Parameter(
            name="torque",
            unit="effort",
            at_least=0.0,
            doc="largest torque that the brake holds, and torque with which it slows the joint down",
        ),
        *WINDOW,
    ),
    loads=loads,
    idle=idle,
    friction_joint="joint",
)
