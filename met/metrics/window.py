"""The window of a run that a metric of a condition looks at: its samples from `after` on, for the duration `within`.

Both ends belong to it. They are decimals, and so is the time of a sample: four units in the last place are allowed for
the rounding of the three.
"""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

from met.metrics.metric import OverJoints
from met.parameter import Parameter
from met.trace import Real, Truth, both, maximum, minimum

AFTER = Parameter(name="after", unit="s", default=0.0, at_least=0.0, doc="start of the time window that is evaluated")
WITHIN = Parameter(
    name="within", unit="s", default=math.inf, at_least=0.0, doc="length of the time window that is evaluated"
)
WINDOW = (AFTER, WITHIN)

EVERY_JOINT = OverJoints("every", lambda margins: reduce(minimum, margins))
ANY_JOINT = OverJoints("any", lambda margins: reduce(maximum, margins))

ROUNDING = 4.0 * 2.0**-52


def inside(p: Any, t: Real) -> Truth:
    """True at samples in the window."""
    return both(t >= p.after * (1.0 - ROUNDING), t <= (p.after + p.within) * (1.0 + ROUNDING))
