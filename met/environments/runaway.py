"""A drive that runs away for a time: whatever its control law commands, the output is full drive, in one direction or
the other.

    output = level * what the servo's limits allow        at times from <= t < until

With a sampled law this holds from its first tick in the window on. The voltage of `rigid_gearbox` and
`compliant_gearbox` is then level v_max, and the commanded current of `cascade` is level i_max, which must be finite.
Integrals go on as if nothing had failed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.environments.environment import WINDOW, Environment, never, open_at
from met.parameter import Parameter
from met.trace import Real, where


def replaced_outputs(p: Any, time: Real, outputs: Mapping[str, Real], full: Mapping[str, Real]) -> Mapping[str, Real]:
    runs = open_at(p, time)
    return {name: where(runs, p.level * full[name], value) for name, value in outputs.items()}


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    return never(getattr(p, "from"), p.until, duration)


ENVIRONMENT = Environment(
    name="runaway",
    doc=__doc__,
    at_rest="nothing",
    parameters=(
        Parameter(name="joint", shape="word", names="joint", doc="joint whose drive runs away"),
        Parameter(
            name="level",
            default=1.0,
            at_least=-1.0,
            at_most=1.0,
            doc="share of full drive; negative in the other direction",
        ),
        *WINDOW,
    ),
    idle=idle,
    servo_of="joint",
    replaced_outputs=replaced_outputs,
)
