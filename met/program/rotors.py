"""Rotors in the links of an arm on a free base, which reacts to their spin (docs/physics.md, section 1).

On a fixed or prescribed base they are left out: their reaction on the links is smaller by the gear's ratio than their
effect at the joints.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from met.dynamics.recursion import FreeRotor, Solved
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.program.system import System
from met.servos.servo import Drive
from met.trace import Real, where


@frozen
class Rotors:
    """The rotors at a stage, by joint.

    spin    of those that turn with their joints (`recursion.solve`), kg m^2 (kg m)
    free    those that turn otherwise; None where the joint has none
    states  by joint, the channel of the state that is a free rotor's rate
    """

    spin: tuple[Real, ...]
    free: tuple[FreeRotor | None, ...]
    states: Mapping[int, str]

    def momenta(self, qd: Sequence[Real]) -> tuple[Real, ...]:
        """Angular momentum about each joint's axis, against the link before it, kg m^2/s, at these joint rates."""
        return tuple(
            spin * rate if free is None else spin * rate + free.momentum
            for spin, free, rate in zip(self.spin, self.free, qd, strict=False)
        )


def of(
    system: System,
    drives: Sequence[Drive | None],
    y: Motion,
    slopes: Sequence[Real],
    friction: Mapping[str, Real],
    on_beds: Collection[int] = (),
) -> Rotors:
    """The rotors that act on a free base.

    slopes    of the servos' states, as if the links that carry the rotors did not turn
    friction  s in {0, +1, -1}, by channel: a rotor that sticks turns with its link
    on_beds   joints whose motors are on a bed: their servos' states are not integrated
    """
    free: list[FreeRotor | None] = [None] * len(drives)
    states: dict[int, str] = {}
    for i, (drive, actuator) in enumerate(zip(drives, system.actuators, strict=True)):
        if drive is None or actuator is None or i in on_beds:
            continue
        for name, inertia in drive.rotors.items():
            channel = f"{actuator.path}.{name}"
            number = system.states.index(channel)
            s = friction.get(channel)
            turns = inertia if s is None else where(s == 0.0, 0.0, inertia)
            free[i] = FreeRotor(turns, turns * slopes[number], inertia * y.x[number])
            states[i] = channel
    return Rotors(tuple(0.0 if drive is None else drive.spin for drive in drives), tuple(free), states)


def against_their_links(
    system: System,
    rotors: Rotors,
    solved: Solved,
    slopes: Sequence[Real],
    needs: Mapping[str, Real],
    friction: Mapping[str, Real],
) -> tuple[tuple[Real, ...], dict[str, Real]]:
    """The slopes of the servos' states, and the friction that must hold them, where a free rotor's rate is relative to
    its link, which turns too."""
    slopes, needs = list(slopes), dict(needs)
    for i, channel in rotors.states.items():
        number, about = system.states.index(channel), solved.about[i]
        s = friction.get(channel)
        slopes[number] = slopes[number] - (about if s is None else where(s == 0.0, 0.0, about))
        if channel in needs:
            needs[channel] = needs[channel] - about
    return tuple(slopes), needs
