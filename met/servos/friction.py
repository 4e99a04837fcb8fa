"""Friction on a motor's shaft: its parameters, and its torque; for servos that have a motor.

    coulomb     dry friction of one level, F_c, which sticks
    stribeck    the level falls from F_s at rest to F_c: F_c + (F_s - F_c) exp(-(w/w_s)^2); it sticks at F_s
    lugre       bristles that bend by z and slip at the same level g(w); they do not stick, but creep back a little:
                z' = w - sigma_0 |w| z/g(w),  torque = sigma_0 z + sigma_1 z'

F_v w is added to each. A gear's loss in proportion to its transmitted torque T is dry friction too: it raises the level
by loss |T|. So a motor that drives needs (1 + loss) T, and one that is driven back holds with (1 - loss) T.

The bristles are stiff: sigma_0 |w|/g is a rate constant, 1/s, that grows with the shaft's rate, and the dynamics' step
must be shorter than the integrator's limit over it.

C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, A New Model for Control of Systems with Friction, IEEE
Transactions on Automatic Control 40, 1995, 419-425; B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, A Survey of
Models, Analysis Tools and Compensation Methods for the Control of Machines with Friction, Automatica 30, 1994. Friction
that depends on the load: P. Hamon, M. Gautier, P. Garrec, Dynamic Identification of Robots with a Dry Friction Model
Depending on Load and Velocity, IROS 2010.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from met.frozen import frozen
from met.parameter import Parameter, State
from met.servos import motor
from met.trace import Real, Truth, absolute, exp, maximum, sign, where

J_M, F_C, F_V = motor.SHAFT
CURVED = ("friction", ("stribeck", "lugre"))
LUGRE = ("friction", ("lugre",))

PARAMETERS = (
    Parameter(
        name="friction",
        shape="word",
        words=("coulomb", "stribeck", "lugre"),
        default="coulomb",
        doc="friction law of the motor's shaft: that of Coulomb, Stribeck or LuGre",
    ),
    Parameter(name="f_s", unit="N*m", at_least=0.0, only=CURVED, doc="breakaway friction F_s on the motor's shaft"),
    Parameter(
        name="rate_s",
        unit="rad/s",
        above=0.0,
        only=CURVED,
        doc="Stribeck rate w_s: motor rate at which dry friction has mostly fallen from F_s to F_c",
    ),
    Parameter(name="sigma_0", unit="N*m/rad", above=0.0, only=LUGRE, doc="stiffness sigma_0 of the bristles"),
    Parameter(
        name="sigma_1", unit="N*m*s/rad", default=0.0, at_least=0.0, only=LUGRE, doc="damping sigma_1 of the bristles"
    ),
)
SHAFT = (
    J_M,
    replace(F_C, only=("friction", ("coulomb", "stribeck"))),
    replace(F_C, default=None, at_least=None, above=0.0, only=LUGRE, source=""),  # bristles unbend with 1/g
    F_V,
)
"""Parameters of a servo whose motor has such friction."""

LOSS = Parameter(
    name="loss",
    default=0.0,
    at_least=0.0,
    below=1.0,
    doc="share of the gear's torque that is added to the dry friction on the motor's shaft",
)

BLOW = 10.0
"""Largest torque that a gear is assumed to transmit, relative to the largest of its motor."""

BRISTLE = State(name="bristle", unit="rad", only=LUGRE, doc="deflection of the bristles of the friction law")


@frozen
class Friction:
    """Friction at a motor rate.

    level    of what sticks, against the motion, N m: for the engine to decide
    torque   of what does not, against the motion, N m
    bending  d(bristle)/dt, rad/s; nothing but with `lugre`
    state_out_of_range  true where the bristles are bent by twice what they can bear: the step is too long for them
    """

    level: Real
    torque: Real
    bending: dict[str, Real]
    state_out_of_range: Truth = False


def friction(p: Any, w: Real, states: Any, transmitted: Real | None = None, strongest: Real = 0.0) -> Friction:
    """Friction at the shaft's rate w (rad/s).

    transmitted  torque on the shaft of a gear that has a loss, N m;  strongest: what its motor gives at most
    """
    level = _level(p, w, transmitted)
    viscous = p.f_v * w
    if p.friction != "lugre":
        return Friction(level, viscous, {})
    slips = level > 0.0
    z = states.bristle
    bending = where(slips, w - p.sigma_0 * absolute(w) * z / where(slips, level, 1.0), 0.0)
    bears = maximum(p.f_s, p.f_c)
    if transmitted is not None:  # a past blow through the gear may have bent them further
        bears = bears + where(p.loss > 0.0, p.loss * maximum(absolute(transmitted), BLOW * strongest), 0.0)
    out_of_range = p.sigma_0 * absolute(z) > 2.0 * bears
    return Friction(0.0, viscous + p.sigma_0 * z + p.sigma_1 * bending, {"bristle": bending}, out_of_range)


def steady(p: Any, w: Real, transmitted: Real | None = None) -> tuple[Real, dict[str, Real]]:
    """Friction at a constant rate w of a shaft: its whole torque against the motion, none at rest, and its states."""
    level = _level(p, w, transmitted)
    bent = {"bristle": sign(w) * level / p.sigma_0} if p.friction == "lugre" else {}
    return p.f_v * w + sign(w) * level, bent


def _level(p: Any, w: Real, transmitted: Real | None) -> Real:
    """The level of dry friction at this rate, N m."""
    level = p.f_c
    if transmitted is not None:
        level = level + where(p.loss > 0.0, p.loss * absolute(transmitted), 0.0)
    if p.friction != "coulomb":
        share = w / p.rate_s
        level = level + (p.f_s - p.f_c) * exp(-(share * share))
    return level
