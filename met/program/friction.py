"""Dry friction that truly sticks: modes are decided at rest, and a step is split where a rate comes to zero.

Each joint with dry friction, and each rate on the motor's side with some, has s in {0, +1, -1}: stuck, sliding forward,
sliding backward, fixed during a (sub)step. Stuck is acceleration mode with qdd = 0, so a stuck joint does not creep,
ever. docs/physics.md, "Friction sticks".
"""

from __future__ import annotations

from collections.abc import Sequence

from met.diagnostic import Problem, error
from met.frozen import frozen
from met.integrators.integrator import Motion, Slope, ahead
from met.plan.following import leaders
from met.program.system import Actuator, System
from met.trace import Real, Truth, absolute, both, either, minimum, not_, sign, sqrt, where


@frozen
class Sticking:
    """A rate that dry friction may hold at zero: a joint's, or a state of its servo.

    name      of its cells: the joint, or the state's channel
    cell      that holds the rate
    actuator  the servo whose physics gives its friction; None of a joint without one
    state     name of the state; "" where it is the joint
    number    of the joint in `Motion.qd`; of the state in `Motion.x`
    level     of its friction, where it is the same at all times and for all cases; None where it varies
    followers  numbers of joints with dry friction that follow it: all of them stick and slide with it
    """

    name: str
    cell: str
    actuator: Actuator | None
    state: str
    number: int
    level: float | None
    followers: tuple[int, ...] = ()

    def rate(self, y: Motion) -> Real:
        return y.x[self.number] if self.state else y.qd[self.number]


def sticking(system: System) -> tuple[Sticking, ...]:
    """The joints, and then the states, that may stick by dry friction. A joint whose motor is on a bed is not among
    them, since its friction is the bed's own."""
    on_bed = [actuator.index for actuator, _, _ in system.mounted]
    free = [actuator for actuator in system.working if actuator.index not in on_bed]
    own = [
        None if joint.name in system.braked else 0.0 if actuator is None else actuator.level
        for joint, actuator in zip(system.joints, system.actuators, strict=True)
    ]
    known = {joint.name: joint for joint in system.joints}
    followers: dict[int, tuple[int, ...]] = {}
    for joint in system.followers:
        i = system.joints.index(joint)
        if own[i] != 0.0:
            first, *more = (system.joints.index(known[name]) for name in leaders(joint.name, known))
            actuator = system.actuators[first]
            if more or first in on_bed or (actuator is not None and actuator.gives):
                message = f"joint `{joint.name}` has dry friction, and no torque of one joint that leads it feels that"
                help = "leave the friction out, or put it on the joints that lead"
                raise Problem(error("E219", message, joint.place, help=help))
            followers[first] = (*followers.get(first, ()), i)
    joints = []
    for i, (joint, actuator) in enumerate(zip(system.joints, system.actuators, strict=True)):
        level = None if i in followers else own[i]
        if i not in on_bed and level != 0.0 and not joint.follows:
            joints.append(Sticking(joint.name, f"{joint.name}.qd", actuator, "", i, level, followers.get(i, ())))
    names = system.states
    states = [
        Sticking(f"{a.path}.{name}", f"{a.path}.{name}", a, name, names.index(f"{a.path}.{name}"), level)
        for a in free
        for name, level in a.levels.items()
        if level != 0.0
    ]
    return (*joints, *states)


SPLITS = 2
"""Largest number of splits of a step; a later crossing is clamped to the step's end, and counted."""


def decision_passes(count: int) -> int:
    """Largest number of decision passes at rest for this many things with dry friction: two each.

    A pass changes the modes of all violators at once. Where many interact that may go round in a circle: then they are
    changed one by one.
    """
    return max(3, 2 * count)


def sequential_passes(count: int) -> int:
    """Largest number of passes that change only the mode of the first violator, in a fixed order.

    Modes at rest are a linear complementarity problem with bounds, and its matrix, of the inertia of what is at rest,
    is positive definite: so the least-index rule ends (J. J. Judice, F. M. Pires, Basic-set algorithm for a generalized
    linear complementarity problem, Journal of Optimization Theory and Applications 74, 1992, 391-411). In theory that
    may take 3^count passes; of 436 random chains of 3 to 30 joints that had gone round in a circle, among 80,000, none
    took more than 4 for each.
    """
    return 0 if count < 2 else 8 * count * count


def decide(s: Real, at_rest: Truth, need: Real, dry: Real, qdd: Real) -> Real:
    """The mode after one decision pass, from what the pass found with mode s.

    need  torque that friction must hold for the joint to stay (N m; N), dry its limit, qdd the acceleration found
    """
    breaks_away = both(s == 0.0, absolute(need) > dry)
    turned_back = both(s != 0.0, s * qdd < 0.0)
    at_rest_now = where(breaks_away, sign(need), where(turned_back, 0.0, s))
    return where(at_rest, at_rest_now, s)


def crossings(s: Sequence[Real | None], y_new: Motion) -> list[Truth]:
    """For each rate, true where a sliding one has come to zero, or beyond, at the step's end.

    s  one for each of qd and then x; None: no dry friction
    """
    return [
        False if mode is None else both(mode != 0.0, mode * rate <= 0.0)
        for mode, rate in zip(s, (*y_new.qd, *y_new.x), strict=True)
    ]


@frozen
class Split:
    """The stop of a (sub)step at a crossing: the state there, what crosses at rest, and the share of the step done."""

    y: Motion
    share: Real


def split_at_rest(y: Motion, k1: Slope, y_new: Motion, h: Real, s: Sequence[Real | None], *, may_split: Truth) -> Split:
    """Find the first instant in the step at which something that slides comes to rest, and stop there.

    Between its ends the step is the parabola through y with slope k1 and through y_new. Where `may_split` is false the
    step is kept whole and everything that crosses is put to rest at its end. s: as `crossings` has it
    """
    crossed = crossings(s, y_new)
    shares = [
        2.0 if crossing is False else where(crossing, first_root(rate, h * slope, end), 2.0)
        for crossing, rate, slope, end in zip(
            crossed, (*y.qd, *y.x), (*k1.qdd, *k1.xd), (*y_new.qd, *y_new.x), strict=True
        )
    ]
    first: Real = 1.0
    for share in shares:
        first = minimum(first, share)
    part = _part_way(y, k1, y_new, h, first)
    whole = not_(may_split)
    q, qd, x = (
        tuple(where(whole, b, a) for a, b in zip(rest, end, strict=True))
        for rest, end in ((part.q, y_new.q), (part.qd, y_new.qd), (part.x, y_new.x))
    )
    rates = tuple(
        where(both(crossing, either(whole, share <= first)), 0.0, rate)
        for crossing, share, rate in zip(crossed, shares, (*qd, *x), strict=True)
    )
    return Split(Motion(q, rates[: len(qd)], rates[len(qd) :]), where(whole, 1.0, first))


def first_root(rate: Real, slope: Real, end: Real) -> Real:
    """Smallest root in (0, 1] of the parabola from `rate` at 0, with slope `slope` there, to `end` at 1; else 1."""
    curve = end - rate - slope
    reach = sqrt(slope * slope - 4.0 * curve * rate)
    half = -0.5 * (slope + where(slope >= 0.0, reach, -reach))
    root, other = half / curve, rate / half
    root = where(both(root > 0.0, root <= 1.0), root, 1.0)
    other = where(both(other > 0.0, other <= 1.0), other, 1.0)
    return minimum(root, other)


def _part_way(y: Motion, k1: Slope, y_new: Motion, h: Real, share: Real) -> Motion:
    """The parabola at `share` of the step: y + share h k1 + share^2 (y_new - y - h k1)."""
    straight = ahead(y, h, k1)
    along = ahead(y, share * h, k1)
    square = share * share

    def bend(start: tuple[Real, ...], end: tuple[Real, ...], line: tuple[Real, ...]) -> tuple[Real, ...]:
        return tuple(a + square * (b - c) for a, b, c in zip(start, end, line, strict=True))

    return Motion(
        bend(along.q, y_new.q, straight.q), bend(along.qd, y_new.qd, straight.qd), bend(along.x, y_new.x, straight.x)
    )
