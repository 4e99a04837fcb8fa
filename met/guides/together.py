"""Synchronous point-to-point motion: all joints begin and arrive together, as fast as their limits allow.

    q = begins + s(t) (to - begins)       s from 0 to 1, its rate a trapezoid in time (met/commands/trapezoid.py)

The limits of s are those of the joint that has the least for its way: max_rate/|way| and max_acceleration/|way|, each
the smallest of all joints (KinematicPTP of the Modelica Standard Library does the same). So the arm moves on a straight
line in joint coordinates, and the slowest joint sets the time. A joint whose `to` is where it begins stays there.

It is not a limiter: it knows neither the positions of the joints nor the limits of their servos. The acceleration jumps
at the corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from met.commands import trapezoid
from met.guides.guide import Guide
from met.parameter import Parameter
from met.trace import Real, absolute, maximum, where


def course(p: Any, joints: Sequence[Any], begins: Sequence[Real], t: Real) -> list[tuple[Real, Real]]:
    """Position and rate of each joint's command at time `t`, s; rad and rad/s, of a prismatic joint m and m/s. begins:
    the joints' positions at the start."""
    ways = [joint.to - begin for joint, begin in zip(joints, begins, strict=True)]
    slow: Real = 0.0  # 1/limit of the rate of s, and of its second derivative
    late: Real = 0.0
    for way, joint in zip(ways, joints, strict=True):
        slow = maximum(slow, absolute(way) / joint.max_rate)
        late = maximum(late, absolute(way) / joint.max_acceleration)
    s, rate = trapezoid.course(
        SimpleNamespace(
            start=0.0,
            to=1.0,
            begin=p.begin,
            max_rate=1.0 / where(slow == 0.0, 1.0, slow),
            max_acceleration=1.0 / where(late == 0.0, 1.0, late),
        ),
        t,
    )
    return [
        (where(s >= 1.0, joint.to, begin + s * way), rate * way)
        for joint, begin, way in zip(joints, begins, ways, strict=True)
    ]


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why the guide moves nothing in a run of this length, with the parameters that say so."""
    if p.begin >= duration:
        return ("begin",), f"moves nothing: it would begin at {p.begin:g} s, and the run ends at {duration:g} s"
    return None


GUIDE = Guide(
    name="together",
    doc=__doc__,
    parameters=(Parameter(name="begin", unit="s", default=0.0, at_least=0.0, doc="time at which the move begins"),),
    of_joint=(
        Parameter(name="to", unit="joint", doc="position after the move"),
        Parameter(name="max_rate", unit="joint/s", above=0.0, doc="largest rate"),
        Parameter(name="max_acceleration", unit="joint/s^2", above=0.0, doc="largest acceleration"),
    ),
    commands=("position",),
    idle=idle,
    course=course,
)
