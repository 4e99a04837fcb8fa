"""A shaft with dry friction over a time in which its drive is held, in closed form.

    J w' = smooth - a J (w - w_0) - s F_c,   s in {0, +1, -1}

`smooth` is all smooth torque at the beginning, `a` the rate at which it falls as the shaft gains speed (back-EMF and
viscous friction). s is the sign of w, and at rest that of a torque which breaks the shaft away. A rate that would cross
zero stops there exactly: the rest of the time is lost, so the time must be short against the motion, but not against
1/a.
"""

from __future__ import annotations

from met.trace import Real, Truth, absolute, both, exp, sign, where


def stuck(w: Real, smooth: Real, dry: Real) -> Truth:
    """True where a shaft at rest stays there: friction's level `dry` (N m) holds the smooth torque."""
    return both(w == 0.0, absolute(smooth) <= dry)


def slid(w: Real, smooth: Real, dry: Real, *, inertia: Real, decay: Real, time: Real) -> Real:
    """The rate after `time` s, rad/s.

    w        rate at the beginning, rad/s
    smooth   smooth torque at the beginning, N m;  dry: level of dry friction, N m
    inertia  kg m^2;  decay: a, above 0, 1/s
    """
    s = where(w == 0.0, sign(smooth), sign(w))
    gained = (smooth - s * dry) / inertia * lasting(decay, time)
    after = where(stuck(w, smooth, dry), 0.0, w + gained)
    return where(s * after < 0.0, 0.0, after)


def lasting(decay: Real, time: Real) -> Real:
    """(1 - exp(-a t))/a: the effective duration, s, of a push that decays with the rate a."""
    return (1.0 - exp(-decay * time)) / decay
