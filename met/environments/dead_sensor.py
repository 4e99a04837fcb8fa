"""A sensor that is dead for a time: the joint's law sees nothing of a quantity, or what it saw last.

    zero   the law sees 0
    last   the law sees what it saw at its last tick before

at times from <= t < until. It is the last thing on the way to the law: behind the servo's own sensor, if it has one.
"""

from __future__ import annotations

from typing import Any

from met.environments.environment import Environment
from met.environments.window import WINDOW, never, open_at
from met.parameter import Parameter
from met.trace import Real, where


def replaced_reading(p: Any, time: Real, of: str, value: Real, last: Real) -> Real:
    if of != p.of:
        return value
    return where(open_at(p, time), 0.0 if p.reads == "zero" else last, value)


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    return never(getattr(p, "from"), p.until, duration)


ENVIRONMENT = Environment(
    name="dead_sensor",
    doc=__doc__,
    parameters=(
        Parameter(name="joint", shape="word", names="joint", doc="joint whose control law does not see the quantity"),
        Parameter(
            name="of",
            shape="word",
            doc="quantity that the control law does not see: `q`, `qd`, or a state of the servo such as `motor_rate`",
        ),
        Parameter(
            name="reads",
            shape="word",
            words=("zero", "last"),
            default="zero",
            doc="what the control law sees instead: 0, or the value at its last tick before the failure",
        ),
        *WINDOW,
    ),
    idle=idle,
    servo_of="joint",
    replaced_reading=replaced_reading,
)
