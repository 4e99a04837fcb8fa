"""Locked joint: it does not move, whatever the arm does, until it is released; then it is free.

    t < release     qdd = 0; tau is what the lock takes
    afterwards      tau = 0

A case that begins locked begins at rest. The mode is the same for a whole step of the dynamics: the joint is locked in
all steps that begin before `release`, so a release between two steps takes effect at the next one.

This is not a brake: it holds any torque, and does not slow down a joint that moves. For that, see the friction of
`passive`.
"""

from __future__ import annotations

import math
from typing import Any

from met.instants import has_come
from met.parameter import Parameter
from met.servos.servo import Drive, JointMotion, Servo
from met.trace import Truth, not_


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    return Drive(given=not_(has_come(joint.begin, p.release)), qdd=0.0)


def at_rest(p: Any) -> Truth:
    """True: a joint that moved while locked would move for ever."""
    return p.release > 0.0


SERVO = Servo(
    name="locked",
    doc=__doc__,
    parameters=(
        Parameter(
            name="release",
            unit="s",
            default=math.inf,
            at_least=0.0,
            doc="time at which the joint is released; by default never",
        ),
    ),
    drive=drive,
    at_rest=at_rest,
)
