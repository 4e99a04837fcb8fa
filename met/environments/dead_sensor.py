"""A sensor that fails for a time: the control law of a joint does not see a quantity, but zero or the last value.

    zero   the law sees 0
    last   the law sees what it saw at its last tick before

at times from <= t < until. The failure is the last element on the way to the law: it comes after the servo's own
sensor, if there is one.
"""

from __future__ import annotations

from typing import Any

from met.environments.environment import WINDOW, Environment, never, open_at
from met.parameter import Parameter
from met.trace import Real, where


def replaced_reading(p: Any, time: Real, quantity: str, value: Real, last: Real) -> Real:
    if quantity != p.of:
        return value
    return where(open_at(p, time), 0.0 if p.reads == "zero" else last, value)


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    return never(getattr(p, "from"), p.until, duration)


ENVIRONMENT = Environment(
    name="dead_sensor",
    doc=__doc__,
    at_rest="nothing",
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
