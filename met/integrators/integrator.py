"""The declaration of an integrator: the function from the state at the start of a step to the state at its end.

The first stage's slopes are given (they are recorded at an instant); the integrator computes the rest. Friction modes
are fixed during a step, so the slope is smooth in it; the engine finds the crossing of a rate through zero on the
parabola through both ends (docs/physics.md, "Friction sticks").
"""

from __future__ import annotations

from collections.abc import Callable

from met.frozen import frozen
from met.trace import Real

Reals = tuple[Real, ...]


@frozen
class Motion:
    """A state of the whole arm: joint positions q, rates qd (rad, rad/s; m, m/s), other integrated states x."""

    q: Reals
    qd: Reals
    x: Reals = ()


@frozen
class Slope:
    """The derivative of a `Motion`: qd of the positions, qdd of the rates, xd of the other states."""

    qd: Reals
    qdd: Reals
    xd: Reals = ()


def ahead(y: Motion, h: Real, k: Slope) -> Motion:
    """y + h k."""
    return Motion(
        tuple(a + h * b for a, b in zip(y.q, k.qd, strict=True)),
        tuple(a + h * b for a, b in zip(y.qd, k.qdd, strict=True)),
        tuple(a + h * b for a, b in zip(y.x, k.xd, strict=True)),
    )


def by_parts(rule: Callable[..., Real], *slopes: Slope) -> Slope:
    """A function of slopes that applies `rule` to each of their parts."""
    return Slope(
        tuple(rule(*parts) for parts in zip(*(k.qd for k in slopes), strict=True)),
        tuple(rule(*parts) for parts in zip(*(k.qdd for k in slopes), strict=True)),
        tuple(rule(*parts) for parts in zip(*(k.xd for k in slopes), strict=True)),
    )


def mean(k1: Slope, k2: Slope) -> Slope:
    """(k1 + k2)/2."""
    return by_parts(lambda a, b: 0.5 * (a + b), k1, k2)


@frozen(kw_only=True)
class Integrator:
    """The declaration of an integrator; one a file.

    order       the power of the step with which its error falls, where the motion is smooth in every step
    real_limit  the h lambda below which a rate that decays as d(qd)/dt = -lambda qd stays stable
    advance     (slope, h, y, k1) -> y at the end of a step of h s. slope(c, y) is the derivative at the share c of
                the step; k1 = slope(0, y)
    """

    name: str
    doc: str
    order: int
    real_limit: float
    advance: Callable[[Callable[[float, Motion], Slope], Real, Motion, Slope], Motion]
