"""Servos that begin balanced: their states keep their joints from accelerating at the start (docs/physics.md). Booms
begin bent by what they carry.

A limit of voltage, current or torque, or an integral that nothing feeds, makes a servo give less torque than `balance`
needs; behind a gear its states then change at once. No particular limit is assumed: the servo's own law and physics are
evaluated at its start. Dry friction that would hold the rest counts as holding, at the joint and behind a gear.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from met.frozen import frozen
from met.integrators.integrator import Motion
from met.program import friction
from met.program.cells import NamedValues, answer, returned
from met.program.evaluation import Derivative, brake_levels, derivative, followers_level, law, servo_response
from met.program.friction import Sticking, sticking
from met.program.system import Actuator, System
from met.servos.servo import Drive, JointMotion, Seen, Setpoint
from met.trace import Real, Truth, absolute, all_of, both, either, maximum, sign, where
from met.trace.program import Tape

SETTLINGS = 10
"""Steps by which booms are put where their loads hold them."""

SETTLED = 1e-7
"""Angle, rad, and share of a spring's own, that it may be away from where its load holds it."""

LEAST_REST = 1e-3


@frozen
class Demand:
    """The demand of a balanced start on a servo.

    torque  that keeps its joint from accelerating, N m (N)
    seen    what its law sees there: a command that the joint be as it is, and the states that `starts` has
    p       its parameters;  starts: memory and states with which it would begin unbalanced, by name
    """

    actuator: Actuator
    torque: Real
    seen: Seen
    p: NamedValues
    starts: Mapping[str, Real]

    def states(self, torque: Real) -> Mapping[str, Real]:
        """States and integrals, by name, with which the servo gives its joint this torque, N m (N), or as much of it as
        it can."""
        servo, parts, owner = self.actuator.servo, self.actuator.parts, self.actuator.owner
        assert servo.balance is not None
        new = answer(owner, servo.balance, self.p, torque, self.seen)
        return returned(owner, "balance", new, [part.name for part in (*parts.natural, *parts.integrals)])


def balance(system: System, tape: Tape, y: Motion, begun: Mapping[str, Mapping[str, Real]]) -> list[Demand]:
    """Write states and integrals of the servos that can be balanced, for the arm at state y; returns the demand on
    each.

    begun  by joint, what its servo holds, and its states, as they begin where it is not balanced
    """
    met = []
    for demand in demands(system, tape, y, begun):
        for name, value in demand.states(demand.torque).items():
            tape.write(f"{demand.actuator.path}.{name}", value)
        met.append(demand)
    return met


def demands(system: System, tape: Tape, y: Motion, begun: Mapping[str, Mapping[str, Real]]) -> Iterator[Demand]:
    """The demands of the start on each servo that can be balanced; y, begun: as for `balance`.

    The torques are those with which none of their joints accelerates. Other joints move as their servos let them; one
    at rest stays where its dry friction holds it while all of them do, and moves where it does not.
    """
    balanced = _balanced(system)
    if balanced:
        loads = _loads(system, tape, y, begun)
        for actuator in balanced:
            yield _demand(system, tape, y, actuator, loads[actuator.index], begun)


def settle_booms(system: System, tape: Tape, y: Motion, begun: Mapping[str, Mapping[str, Real]]) -> None:
    """Write the positions of booms' springs at which none of them moves, for the arm at state y; begun: as for
    `balance`.

    A spring turns by its load over its stiffness, and the load changes as the boom bends. The equations are solved by
    Broyden's method from the unbent boom (C. T. Kelley, Iterative Methods for Linear and Nonlinear Equations, SIAM,
    1995, section 7.3, which keeps the steps alone). `first_unsettled` says where SETTLINGS steps are too few.
    """
    springs, steps = _springs(system), list[list[Real]]()
    for _ in range(SETTLINGS):
        step = [-missing for missing in _turns_missing(system, tape, y, begun)]
        for before, after in pairwise(steps):
            share = _share(before, step)
            step = [a + share * b for a, b in zip(step, after, strict=True)]
        if steps:
            rest = 1.0 - _share(steps[-1], step)
            step = [missing / where(absolute(rest) > LEAST_REST, rest, 1.0) for missing in step]
        steps.append(step)
        q = list(y.q)
        for spring, turn in zip(springs, step, strict=True):
            q[spring.index] = q[spring.index] + turn
        y = replace(y, q=tuple(q))
    for spring in springs:
        tape.write(f"{spring.use.joint}.q", y.q[spring.index])


def first_unsettled(system: System, tape: Tape, y: Motion, begun: Mapping[str, Mapping[str, Real]]) -> Real:
    """The first spring of a boom, by its joint's number from 1, that is not at rest at state y; 0 where all are."""
    first: Real = 0.0
    for spring, missing in reversed([*zip(_springs(system), _turns_missing(system, tape, y, begun), strict=True)]):
        still = absolute(missing) <= maximum(SETTLED * absolute(y.q[spring.index]), SETTLED)
        first = where(still, first, spring.index + 1.0)
    return first


def _turns_missing(system: System, tape: Tape, y: Motion, begun: Mapping[str, Mapping[str, Real]]) -> list[Real]:
    """By how much each spring of a boom is turned too far for its load, rad."""
    loads, missing = _loads(system, tape, y, begun), list[Real]()
    for spring in _springs(system):
        p = system.servo_values(spring, tape.read)
        missing.append(y.q[spring.index] - p.rest + loads[spring.index] / p.stiffness)
    return missing


def _share(before: Sequence[Real], step: Sequence[Real]) -> Real:
    """The share of an earlier step in this one: their product over the square of the earlier one, 0 where that is 0."""
    square = sum((change * change for change in before), 0.0)
    product = sum((a * b for a, b in zip(before, step, strict=True)), 0.0)
    return where(square > 0.0, product / where(square > 0.0, square, 1.0), 0.0)


def _balanced(system: System) -> list[Actuator]:
    return [actuator for actuator in system.working if actuator.servo.balance is not None]


def _springs(system: System) -> list[Actuator]:
    """The actuators of booms' springs."""
    return [actuator for actuator in system.working if actuator.use.joint in system.structure.springs]


def _loads(system: System, tape: Tape, y: Motion, begun: Mapping[str, Mapping[str, Real]]) -> Sequence[Real]:
    """The torques of all joints, N m (N), with which no joint of a balanced servo accelerates; on an arm with booms
    none of their springs either, nor a joint that goes with its command."""
    still, springs = _balanced(system), _springs(system)
    if springs:
        still += springs + [actuator for actuator in system.working if actuator.servo.follows]
    held = [NamedValues("", {} if a is None else begun[a.use.joint]) for a in system.actuators]

    def moved(modes: Mapping[str, Real]) -> Derivative:
        """The derivative at the start, with these modes of friction."""
        return derivative(
            system,
            tape.read,
            y=y,
            held=held,
            friction=modes,
            time=0.0,
            begin=0.0,
            part=tape.part,
            prescribed_qdd={actuator.index: 0.0 for actuator in still},
        )

    others = [other for other in sticking(system) if not other.state and other.actuator not in still]
    levels = {other.name: _level(system, tape, y, other, held) for other in others}
    modes = {other.name: where(levels[other.name] > 0.0, sign(other.rate(y)), 1.0) for other in others}
    trial = moved(modes)
    if others:
        modes = {
            other.name: friction.decide(
                modes[other.name],
                both(levels[other.name] > 0.0, other.rate(y) == 0.0),
                trial.need[other.name],
                levels[other.name],
                trial.slope.qdd[other.number],
            )
            for other in others
        }
        trial = moved(modes)
    return trial.loads


def _demand(
    system: System,
    tape: Tape,
    y: Motion,
    actuator: Actuator,
    torque: Real,
    begun: Mapping[str, Mapping[str, Real]],
) -> Demand:
    """The demand on a servo that is to hold its joint at the start, with its inputs and parameters there."""
    starts, q, qd = begun[actuator.use.joint], y.q[actuator.index], y.qd[actuator.index]
    stays = {"position": Setpoint("position", q, qd), "rate": Setpoint("rate", qd, 0.0)}
    setpoint = stays.get(actuator.command_kind, Setpoint(actuator.command_kind, 0.0, 0.0))
    states = NamedValues(actuator.owner, {state.name: starts[state.name] for state in actuator.parts.natural})
    p = system.servo_values(actuator, tape.read)
    return Demand(actuator, torque, Seen(q, qd, setpoint, 0.0, 0.0, states), p, starts)


def _level(system: System, tape: Tape, y: Motion, part: Sticking, held: Sequence[NamedValues]) -> Real:
    """The level of dry friction at a joint, its servo's and its brakes', N m (N)."""
    on_joints = brake_levels(system, tape.read, y, 0.0, 0.0)
    level = on_joints.get(part.name, 0.0)
    if part.followers:
        level = level + followers_level(system, tape.read, y, part.followers, on_joints, 0.0, 0.0)
    if part.actuator is None:
        return level
    return level + servo_response(system, part.actuator, tape.read, y, held[part.number], 0.0, 0.0).drive.dry


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
