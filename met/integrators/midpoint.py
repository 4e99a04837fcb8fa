"""Midpoint rule: the step is made with the slope at its middle; order 2.

    y+ = y + h f(t + h/2, y + h/2 f(t, y))

It takes two evaluations per step. It is neither Heun's trapezoid (`modified_euler`), which takes the mean of the slopes
at both ends, nor the implicit midpoint rule. With a servo that ticks faster than the dynamics, it sees what the
computer holds at the middle of the step: the mean of the first tick's value and the last one's.
"""

from __future__ import annotations

from collections.abc import Callable

from met.integrators.integrator import Integrator, Motion, Slope, ahead
from met.trace import Real


def advance(slope: Callable[[float, Motion], Slope], h: Real, y: Motion, k1: Slope) -> Motion:
    return ahead(y, h, slope(0.5, ahead(y, 0.5 * h, k1)))


INTEGRATOR = Integrator(name="midpoint", doc=__doc__, order=2, real_limit=2.0, advance=advance)
