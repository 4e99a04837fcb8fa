"""A brake on a joint: dry friction that holds the joint, and slows it down if it moves, while the brake is on.

    torque = -s torque,  s in {0, +1, -1} (held, forward, backward)

Held means that the joint does not move at all, as long as the load on it is no more than `torque`. The friction of the
joint's servo adds to that of the brake. The brake acts at times t with from <= t < until; in a step that is partly in
this window, the same share of the torque acts.

The brake is on the joint's side. A brake on the motor's shaft holds N times its torque, but not against a gear that
winds up. It is not a lock, which holds any torque: see the servo `locked`.
"""

from __future__ import annotations

from typing import Any

from met.environments.environment import WINDOW, Environment, Loads, World, never, share
from met.parameter import Parameter


def loads(p: Any, world: World) -> Loads:
    return Loads(dry={p.joint: share(world, getattr(p, "from"), p.until) * p.torque})


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why these numbers make the model do nothing in a run of this length, with the parameters that say
    so."""
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
