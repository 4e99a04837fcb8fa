"""The classical Runge-Kutta method, order 4.

    k1 = f(t, y),  k2 = f(t + h/2, y + h/2 k1),  k3 = f(t + h/2, y + h/2 k2),  k4 = f(t + h, y + h k3)
    y+ = y + h/6 (k1 + 2 k2 + 2 k3 + k4)

It takes four evaluations per step. All steps have one length: it does not control its step. It is of order 4 if the
motion is smooth in every step. The instant at which dry friction splits a step is found on a parabola, and a stuck
joint breaks away at the start of a step: with such events it is of order 2. W. Kutta, Zeitschrift fuer Mathematik und
Physik 46, 1901, 435-453.
"""

from __future__ import annotations

from collections.abc import Callable

from met.integrators.integrator import Integrator, Motion, Slope, ahead, by_parts
from met.trace import Real


def advance(slope: Callable[[float, Motion], Slope], h: Real, y: Motion, k1: Slope) -> Motion:
    """The state after a step of h s by the classical method of order 4. k1: the slope at its start"""
    k2 = slope(0.5, ahead(y, 0.5 * h, k1))
    k3 = slope(0.5, ahead(y, 0.5 * h, k2))
    k4 = slope(1.0, ahead(y, h, k3))
    return ahead(y, h, by_parts(lambda a, b, c, d: (a + 2.0 * (b + c) + d) / 6.0, k1, k2, k3, k4))


# |1 - x + x^2/2 - x^3/6 + x^4/24| reaches 1 at x = 2.785293563405...
INTEGRATOR = Integrator(name="rk4", doc=__doc__, order=4, real_limit=2.785293563405282, advance=advance)
