"""An elastic gear between a motor and its joint: its parameters, and its torque; for servos that have one.

With d = theta/N - q, the motor's angle over the ratio less the joint's, everything at the joint's side:

    spring   k1 x + k3 x^3,  x = d beyond half of the play on either side, 0 within
    damping  c d', and where there is play no more than the spring's torque, either way: teeth push and never pull

The spring's share is its potential energy, k1 x^2/2 + k3 x^4/4. The damping takes energy out, whatever its limit.
"""

from __future__ import annotations

from typing import Any

from met.parameter import Only, Parameter, State
from met.trace import Real, absolute, both, clip, exp, log, minimum, sign, where


def parameters(only: Only | None = None) -> tuple[Parameter, ...]:
    """Parameters of a servo with such a gear."""
    return (
        Parameter(
            name="stiffness",
            unit="effort/joint",
            above=0.0,
            only=only,
            doc="stiffness k1 of the gear, seen at the joint",
        ),
        Parameter(
            name="hardening",
            unit="effort/joint^3",
            default=0.0,
            at_least=0.0,
            only=only,
            doc="cubic stiffness k3 of the gear, seen at the joint",
        ),
        Parameter(
            name="backlash",
            unit="joint",
            default=0.0,
            at_least=0.0,
            only=only,
            doc="play of the gear from end to end, seen at the joint",
        ),
        Parameter(
            name="damping",
            unit="effort*s/joint",
            default=0.0,
            at_least=0.0,
            only=only,
            doc="damping c of the gear, seen at the joint",
        ),
    )


def deflection(only: Only | None = None) -> State:
    """The declaration of the state that winds the gear up."""
    doc = "winding of the gear: the motor's angle divided by the ratio, minus the joint's position"
    return State(name="deflection", unit="joint", in_transmission=True, only=only, doc=doc)


def torque(p: Any, d: Real, rate: Real) -> Real:
    """Torque of the gear on the joint, N m (N), wound up by d (rad; m) which grows at this rate."""
    beyond, play = _beyond(p, d), p.backlash > 0.0
    spring = p.stiffness * beyond + p.hardening * (beyond * beyond * beyond)
    most = absolute(spring)
    return spring + where(play, clip(p.damping * rate, -most, most), p.damping * rate)


def energy(p: Any, d: Real) -> Real:
    """Energy in the gear's spring, J, wound up by d (rad; m)."""
    square = _beyond(p, d) * _beyond(p, d)
    return 0.5 * p.stiffness * square + 0.25 * p.hardening * (square * square)


def _beyond(p: Any, d: Real) -> Real:
    """The part of d that is beyond the play, rad (m)."""
    half = 0.5 * p.backlash
    return where(p.backlash > 0.0, d - clip(d, -half, half), d)


def wound(p: Any, transmitted: Real) -> Real:
    """The deflection, rad (m), at which the gear transmits this torque, N m (N), and keeps to it.

    The root of the spring's cubic: from a start of at most twice the root, five Newton steps converge to rounding.
    """
    size, hardens = absolute(transmitted), p.hardening > 0.0
    k3 = where(hardens, p.hardening, 1.0)
    cubic = exp(log(where(size > 0.0, size / k3, 1.0)) / 3.0)
    x = size / p.stiffness
    x = where(both(hardens, size > 0.0), minimum(x, cubic), x)
    for _ in range(5):
        beyond = p.stiffness * x + k3 * (x * x * x) - size
        x = where(hardens, x - beyond / (p.stiffness + 3.0 * k3 * (x * x)), x)
    return sign(transmitted) * (x + 0.5 * p.backlash)
