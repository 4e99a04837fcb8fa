"""A test of servos that begin balanced: their torque must be the one that the joint takes, and must last.

A limit of voltage, current or torque, or an integral that nothing feeds, makes a servo give less torque than `balance`
needs; behind a gear its states then change at once. No particular limit is assumed: the servo's own law and physics are
evaluated at its start. Dry friction that would hold the rest counts as holding, at the joint and behind a gear.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from met.integrators.integrator import Motion
from met.program.balancing import Demand
from met.program.evaluation import brake_levels, law
from met.program.system import System
from met.program.values import NamedValues, answer
from met.servos.servo import Drive, JointMotion, Setpoint
from met.trace import Real, Truth, absolute, all_of, either, maximum, sign, where
from met.trace.program import Tape

SHARE = 1e-6
"""Share of the torque, and of the numbers on which a slope depends, that counts as zero: far above rounding."""

LEAST = 1e-9
"""Torque, N m (N), that counts as zero: rounding leaves as much where there is no load."""


def first_unheld(system: System, tape: Tape, y: Motion, demands: Sequence[Demand]) -> Real:
    """The first joint, by its number from 1, whose servo cannot hold it at the start, at state y; 0 where all do."""
    brakes = brake_levels(system, tape.read, y, 0.0, 0.0)
    first: Real = 0.0
    for demand in reversed(demands):
        joint = demand.actuator.index
        held = holds(demand, demand.torque, brakes.get(system.joints[joint].name, 0.0))
        first = where(held, first, joint + 1.0)
    return first


def holds(demand: Demand, torque: Real, brake: Real, *, commanded: bool = False) -> Truth:
    """True where the servo, begun with states for this torque (N m; N) on its joint, gives the torque and keeps giving
    it.

    brake      dry friction of brakes on the joint, N m (N)
    commanded  whether a servo that is commanded a torque is commanded this one, and not what its deck says
    """
    own = {**demand.starts, **demand.states(torque)}
    if demand.seen.setpoint.kind == "torque":
        if not commanded:
            return True  # the command decides the torque
        demand = replace(demand, seen=replace(demand.seen, setpoint=Setpoint("torque", torque, 0.0)))
    outputs = _outputs(demand, own)
    drive = _drive(demand, own, outputs)
    qd = demand.seen.qd
    dry = drive.dry + brake
    missing = absolute(drive.torque - sign(qd) * drive.dry - torque) - where(qd == 0.0, dry, 0.0)
    lasting = [missing <= maximum(SHARE * absolute(torque), LEAST)]
    slack = _slack(demand, own, outputs, drive)
    for state in demand.actuator.parts.natural:
        rate, level = own[state.name], drive.friction.get(state.name, 0.0)
        slope = absolute(drive.slopes[state.name] - sign(rate) * level) - where(rate == 0.0, level, 0.0)
        lasting.append(slope <= slack[state.name])
    return either(absolute(torque) <= LEAST, all_of(lasting))


def _outputs(demand: Demand, own: Mapping[str, Real]) -> Mapping[str, Real]:
    """The outputs of the servo's law with this memory and these states."""
    actuator, p, seen = demand.actuator, demand.p, demand.seen
    held = NamedValues(actuator.owner, own)
    q, qd = seen.q, seen.qd
    if actuator.servo.measured is not None:
        q, qd = answer(actuator.owner, actuator.servo.measured, p, q, qd, held)
    return law(actuator, p, held, replace(seen, q=q, qd=qd, states=held)).outputs


def _drive(demand: Demand, own: Mapping[str, Real], outputs: Mapping[str, Real]) -> Drive:
    """The servo's physics with these states, under these outputs of its law."""
    actuator, seen = demand.actuator, demand.seen
    motion = JointMotion(seen.q, seen.qd, 0.0, 0.0, actuator.command_kind)
    held = NamedValues(actuator.owner, {**own, **outputs})
    return answer(actuator.owner, actuator.servo.drive, demand.p, held, NamedValues(actuator.owner, own), motion)


def _slack(demand: Demand, own: Mapping[str, Real], outputs: Mapping[str, Real], drive: Drive) -> dict[str, Real]:
    """Slopes of the servo's states that count as zero, by name: their change if each number that they depend on changed
    by `SHARE`."""
    names = [state.name for state in demand.actuator.parts.natural]
    slack: dict[str, Real] = dict.fromkeys(names, 0.0)
    moved = [({**own, name: (1.0 + SHARE) * own[name]}, outputs) for name in names]
    moved += [(dict(own), {**outputs, name: (1.0 + SHARE) * value}) for name, value in outputs.items()]
    for states, changed in moved:
        other = _drive(demand, states, changed)
        for name in names:
            slack[name] = slack[name] + absolute(other.slopes[name] - drive.slopes[name])
    return slack
