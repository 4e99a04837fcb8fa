"""Servos that begin balanced: what keeps their joints from accelerating at the start is there (docs/physics.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from met.integrators.integrator import Motion
from met.program import friction
from met.program.evaluation import Derivative, brake_levels, derivative, servo_response
from met.program.sticking import Sticking, sticking
from met.program.system import System
from met.program.values import NamedValues, answer, returned
from met.servos.servo import Seen, Setpoint
from met.trace import Real, both, sign, where
from met.trace.program import Tape


def balance(system: System, tape: Tape, y: Motion, begun: Mapping[str, Mapping[str, Real]]) -> None:
    """Writes states and integrals of the servos that can be balanced, for the arm at state y.

    begun  by joint, what its servo holds, and its states, as they begin where it is not balanced

    The torques are those with which none of their joints accelerates. Other joints move as their servos let them; one
    at rest stays where its dry friction holds it while all of them do, and moves where it does not.
    """
    balanced = [actuator for actuator in system.working if actuator.servo.balance is not None]
    if not balanced:
        return
    held = [NamedValues("", {} if a is None else begun[a.use.joint]) for a in system.actuators]

    def moved(modes: Mapping[str, Real]) -> Derivative:
        return derivative(
            system,
            tape.read,
            y=y,
            held=held,
            friction=modes,
            time=0.0,
            begin=0.0,
            part=tape.part,
            prescribed_qdd={actuator.index: 0.0 for actuator in balanced},
        )

    others = [each for each in sticking(system) if not each.state and each.actuator not in balanced]
    levels = {each.name: _level(system, tape, y, each, held) for each in others}
    modes = {each.name: where(levels[each.name] > 0.0, sign(each.rate(y)), 1.0) for each in others}
    found = moved(modes)
    if others:
        modes = {
            each.name: friction.decide(
                modes[each.name],
                both(levels[each.name] > 0.0, each.rate(y) == 0.0),
                found.need[each.name],
                levels[each.name],
                found.slope.qdd[each.number],
            )
            for each in others
        }
        found = moved(modes)
    for actuator in balanced:
        assert actuator.servo.balance is not None
        parts, starts = actuator.parts, begun[actuator.use.joint]
        q, qd = y.q[actuator.index], y.qd[actuator.index]
        stays = {"position": Setpoint("position", q, qd), "rate": Setpoint("rate", qd, 0.0)}
        setpoint = stays.get(actuator.command_kind, Setpoint(actuator.command_kind, 0.0, 0.0))
        states = NamedValues(actuator.owner, {state.name: starts[state.name] for state in parts.natural})
        seen = Seen(q, qd, setpoint, 0.0, 0.0, states)
        p = system.servo_values(actuator, tape.read)
        new = answer(actuator.owner, actuator.servo.balance, p, found.loads[actuator.index], seen)
        names = [part.name for part in (*parts.natural, *parts.integrals)]
        for name, value in returned(actuator.owner, "balance", new, names).items():
            tape.write(f"{actuator.path}.{name}", value)


def _level(system: System, tape: Tape, y: Motion, each: Sticking, held: Sequence[NamedValues]) -> Real:
    """The level of dry friction at a joint, its servo's and its brakes', N m (N)."""
    on_joints = brake_levels(system, tape.read, y, 0.0, 0.0)
    level = on_joints.get(each.name, 0.0)
    if each.actuator is None:
        return level
    return level + servo_response(system, each.actuator, tape.read, y, held[each.number], 0.0, 0.0).drive.dry
