"""A joint that swings freely for a time: its drive has let go of it, and neither drives, holds nor brakes it.

Torque, dry friction and acceleration of the joint's servo do not reach the joint at times t with from <= t < until; of
a step that lies in this window in part, in proportion. What inertia of the rotor moves with the joint still does;
behind an elastic gear the motor is let go too, and turns by itself, and the gear unwinds within a few steps. It takes
hold again with nothing wound up, wherever motor and joint are by then; of other rates, with a blow. Nothing is aligned:
a position loop finds the joint where it is.
"""

from __future__ import annotations

from typing import Any

from met.environments.environment import Environment
from met.environments.window import WINDOW, Step, never, share
from met.parameter import Parameter
from met.trace import Real


def decoupling(p: Any, step: Step) -> Real:
    return share(step, getattr(p, "from"), p.until)


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    return never(getattr(p, "from"), p.until, duration)


ENVIRONMENT = Environment(
    name="free_swinging",
    doc=__doc__,
    parameters=(Parameter(name="joint", shape="word", names="joint", doc="joint that swings freely"), *WINDOW),
    idle=idle,
    servo_of="joint",
    decoupling=decoupling,
)
