"""Semi-implicit Euler: the rates first, then the positions with the new rates; order 1.

    qd+ = qd + h qdd(t, y),  q+ = q + h qd+,  x+ = x + h xd(t, y)        x: states of servos

It takes one evaluation per step, and is the cheapest method. It is also called symplectic Euler: if inertia does not
depend on the pose and forces do not depend on rates, the energy stays within a band of the size of the step instead of
drifting away. An arm of several joints is seldom so, and then there is no such promise. It is not the explicit Euler
rule, which moves the positions with the old rates and gains energy; and it is not an implicit method: nothing is solved
for, and it is stable no further than the explicit ones. A damped spring with both roots at -w, such as `ideal` under a
position command, is stable below h w = 2 sqrt(2) - 2 = 0.83.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from met.integrators.integrator import Integrator, Motion, Slope, ahead
from met.trace import Real


def advance(slope: Callable[[float, Motion], Slope], h: Real, y: Motion, k1: Slope) -> Motion:
    rates = ahead(y, h, k1).qd
    return ahead(y, h, replace(k1, qd=rates))


INTEGRATOR = Integrator(name="semi_implicit_euler", doc=__doc__, order=1, real_limit=2.0, advance=advance)
