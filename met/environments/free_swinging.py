"""A joint that swings freely for a time: its drive is disconnected, and neither drives, holds nor brakes it.

Torque, dry friction and acceleration of the joint's servo do not reach the joint at times t with from <= t < until; in
a step that is partly in this window, they act in proportion. The inertia of a rotor that moves with the joint still
does. Behind an elastic gear the motor is disconnected too, and turns by itself, and the gear unwinds within a few
steps. The drive engages again with an unwound gear, wherever motor and joint are by then; if their rates differ, with
an impact. Nothing is realigned: a position loop finds the joint where it is.
"""

from __future__ import annotations

from typing import Any

from met.environments.environment import WINDOW, Environment, Step, never, share
from met.parameter import Parameter
from met.trace import Real


def decoupling(p: Any, step: Step) -> Real:
    return share(step, getattr(p, "from"), p.until)


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    return never(getattr(p, "from"), p.until, duration)


ENVIRONMENT = Environment(
    name="free_swinging",
    doc=__doc__,
    at_rest="nothing",
    parameters=(Parameter(name="joint", shape="word", names="joint", doc="joint that swings freely"), *WINDOW),
    idle=idle,
    servo_of="joint",
    decoupling=decoupling,
)
