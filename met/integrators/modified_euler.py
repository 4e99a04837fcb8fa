"""Modified Euler: Heun's explicit trapezoid, order 2; the paper's integrator and the default.

    y* = y + h f(t, y),  y+ = y + h/2 (f(t, y) + f(t + h, y*))

It takes two evaluations per step. It is not the midpoint rule, which some books also call modified Euler.
"""

from __future__ import annotations

from collections.abc import Callable

from met.integrators.integrator import Integrator, Motion, Slope, ahead, mean
from met.trace import Real


def advance(slope: Callable[[float, Motion], Slope], h: Real, y: Motion, k1: Slope) -> Motion:
    k2 = slope(1.0, ahead(y, h, k1))
    return ahead(y, h, mean(k1, k2))


INTEGRATOR = Integrator(name="modified_euler", doc=__doc__, order=2, real_limit=2.0, advance=advance)
