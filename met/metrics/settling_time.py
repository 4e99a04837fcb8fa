"""The time from which the signal stays within a band around its target, until the end of the run.

It is infinite if the signal is outside the band at the end. The half width of the band is `band` times the size of the
target, plus `within`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.metrics.metric import Metric
from met.parameter import Memory, Parameter
from met.trace import Real, absolute, where


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    inside = absolute(x - p.target) <= p.band * absolute(p.target) + p.within
    return {"since": where(inside, where(held.since < math.inf, held.since, t), math.inf)}


def result(p: Any, held: Any, t: Real) -> Real:
    return held.since


def update_between(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    """The memory after a sample, with the settling time interpolated on the straight line between two samples."""
    outside = absolute(x - p.target) - (p.band * absolute(p.target) + p.within)
    way = held.outside - outside
    entered = t + where(way > 0.0, dt * outside / where(way > 0.0, way, 1.0), 0.0)
    inside = absolute(x - p.target) <= p.band * absolute(p.target) + p.within
    since = where(inside, where(held.since < math.inf, held.since, entered), math.inf)
    return {"since": since, "outside": outside}


PARAMETERS = (
    Parameter(name="target", unit="of", doc="target value of the signal"),
    Parameter(
        name="band",
        unit="1",
        default=0.02,
        at_least=0.0,
        share=True,
        doc="half width of the band around the target, as a share of the target",
    ),
    Parameter(
        name="within",
        unit="of",
        default=0.0,
        at_least=0.0,
        doc="half width of the band around the target that is added to the share `band`",
    ),
)

SINCE = Memory(name="since", unit="s", doc="start of the stretch inside the band; infinite outside", start=math.inf)

BETWEEN = Metric(
    name="settling_time",
    doc=__doc__,
    unit="s",
    parameters=PARAMETERS,
    memory=(SINCE, Memory(name="outside", unit="of", doc="distance beyond the band at the sample before")),
    update=update_between,
    result=result,
)

METRIC = Metric(
    name="settling_time",
    doc=__doc__,
    unit="s",
    least=0.0,
    times=True,
    target="target",
    between=BETWEEN,
    parameters=PARAMETERS,
    memory=(SINCE,),
    update=update,
    result=result,
)
