"""The computers of guides and their setpoints for the joints; setpoints of servos, from guides or their own commands.

A guide ticks at instants, before the servos, so that their setpoints are of this instant. It keeps the integral of its
rates, which starts at the joints' positions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

from met import models
from met.dynamics.coupling import at_leaders
from met.dynamics.kinematics import base_answers, jacobian
from met.dynamics.spatial import (
    Matrix,
    Vector,
    add,
    cross,
    product,
    rotation_rpy,
    scale,
    sub,
    turn_vector,
)
from met.guides.guide import Sight, Stance
from met.integrators.integrator import Motion
from met.parameter import Parameter
from met.plan import GuideUse
from met.program import cells
from met.program.cells import NamedValues, answer, parameters, returned
from met.program.courses import pose_and_rates, rate_of_rpy
from met.program.motion import base, bodies
from met.program.motion.base import BaseMotion
from met.program.system import Actuator, ReadCell, System
from met.servos.servo import Setpoint
from met.trace import Real, sqrt
from met.trace.program import Tape


def ticking(system: System) -> Iterator[GuideUse]:
    """The guides that have a computer."""
    return (use for use in system.structure.guides if models.find("guide", use.model, use.place).steer is not None)


def start(system: System, tape: Tape) -> None:
    """Write the start of guides: the joints' positions, rates of 0, and the guided frames from which paths count."""
    for use in ticking(system):
        tape.write(cells.GUIDE_TIME(use.name), 0.0)
        for joint in use.joints:
            tape.write(cells.GUIDE_POSITION(joint), tape.read(f"{joint}.q"))
            tape.write(cells.GUIDE_RATE(joint), 0.0)
        guide = models.find("guide", use.model, use.place)
        for memory in guide.memory:
            tape.write(f"guides.{use.name}.{memory.name}", memory.start)
        if guide.components is not None:
            stance = _ArmAt(system, use, tape.read, *_state(system, tape, 0.0)).stance(answers=False)
            for name, value in zip(_begun(use), (*(x for row in stance.R for x in row), *stance.p), strict=True):
                tape.write(name, value)


def tick(system: System, tape: Tape, use: GuideUse) -> None:
    """One tick of a guide's computer, on the state at this time."""
    guide = models.find("guide", use.model, use.place)
    assert guide.steer is not None
    period = use.divisor / system.structure.schedule.base_hz
    begun = {joint: tape.read(cells.GUIDE_POSITION(joint)) for joint in use.joints}
    positions = {joint: position + period * tape.read(cells.GUIDE_RATE(joint)) for joint, position in begun.items()}
    y, stands = _state(system, tape, tape.time)
    number = {joint.name: i for i, joint in enumerate(system.joints)}
    q = [positions.get(joint.name, y.q[i]) for i, joint in enumerate(system.joints)]
    commanded = Motion((*q, *y.q[len(q) :]), y.qd, y.x)
    sight = Sight(
        time=tape.time,
        slides=tuple(system.joints[number[joint]].kind == "prismatic" for joint in use.joints),
        arm=_ArmAt(system, use, tape.read, y, stands),
        asked=_ArmAt(system, use, tape.read, system.followed(tape.read, commanded), stands),
        wanted=_wanted(system, tape, use),
    )
    steered = answer(owner(use), guide.steer, *own(system, use, tape.read), sight)
    new_memory = returned(owner(use), "steer", steered.memory, (memory.name for memory in guide.memory))
    for name, value in new_memory.items():
        tape.write(f"guides.{use.name}.{name}", value)
    for joint, rate in zip(use.joints, steered.rates, strict=True):
        tape.write(cells.GUIDE_POSITION(joint), positions[joint])
        tape.write(cells.GUIDE_RATE(joint), rate)
    tape.write(cells.GUIDE_TIME(use.name), tape.time)


def way_along(system: System, tape: Tape, use: GuideUse) -> Real:
    """The distance of a guide's path at this time from where it begins, m."""
    way = sub(_wanted(system, tape, use).p, tuple(tape.read(name) for name in _begun(use)[9:]))  # type: ignore[arg-type]
    return sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])


class _ArmAt:
    """A `met.guides.guide.Arm`: the arm with its joints at y.q, and the known parts of its motion at this time."""

    def __init__(self, system: System, use: GuideUse, read: ReadCell, y: Motion, stands: BaseMotion) -> None:
        n = len(system.joints)
        tree, self._base = system.tree(read), stands
        self._free = system.structure.free
        self._loaded_tree = bodies.tree_with_payloads(system, read)
        self._q, self._qd = y.q[:n], y.qd[:n]
        names = [joint.name for joint in system.joints]
        self._own = [names.index(joint) for joint in use.joints]
        point = tuple(system.value(f"guides.{use.name}.point.{axis}", read) for axis in "xyz")
        link = system.value(f"guides.{use.name}.link", read)
        self._ratios = system.ratios(read, self._q)
        self._moves = at_leaders(self._ratios, jacobian(tree, self._q, link, point, stands.pose))
        at_rest = [0.0] * n
        frame = base.motions(tree, self._q, at_rest, BaseMotion(stands.pose))[link]
        self._R, self._p = frame.pose.R, frame.position(point)

    def stance(self, *, answers: bool) -> Stance:
        """The guided frame. Its joints' own rates count only through a free base's reaction to them."""
        w, v = turn_vector(self._base.pose.R, self._base.w), turn_vector(self._base.pose.R, self._base.v)
        if self._free and not answers:
            w, v = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        v = add(v, cross(w, sub(self._p, self._base.pose.p)))
        for i, (angular, linear) in enumerate(self._moves):
            if i not in self._own:
                w, v = add(w, scale(self._qd[i], angular)), add(v, scale(self._qd[i], linear))
            elif self._free and answers:
                angular, linear = self._answers[i]
                w, v = sub(w, scale(self._qd[i], angular)), sub(v, scale(self._qd[i], linear))
        return Stance(self._R, self._p, w, v)

    def columns(self, *, answers: bool) -> Sequence[tuple[Vector, Vector]]:
        """For each joint of the guide, angular and linear velocity of the guided frame for each unit of its rate, world
        axes. answers: with a free base's reaction"""
        moves = [self._moves[i] for i in self._own]
        if not (self._free and answers):
            return moves
        theirs = [self._answers[i] for i in self._own]
        return [(add(w, more), add(v, far)) for (w, v), (more, far) in zip(moves, theirs, strict=True)]

    @cached_property
    def _answers(self) -> list[tuple[Vector, Vector]]:
        """The reaction of a free base to joint rates: the frame's angular velocity and velocity for each unit of each
        rate; with the payloads that the links carry at this time."""
        arm = sub(self._p, self._base.pose.p)
        answers = at_leaders(self._ratios, base_answers(self._loaded_tree, self._q, self._base.pose))
        return [(w, add(v, cross(w, arm))) for w, v in answers]


def _state(system: System, tape: Tape, time: Real) -> tuple[Motion, BaseMotion]:
    """The arm at an instant, and its base."""
    y = bodies.with_zero_turn(system, cells.state(tape, bodies.coordinates(system), system.states))
    return y, base.base_of(system, tape.read, y, time)


def _begun(use: GuideUse) -> list[str]:
    """The cells of the initial guided frame: the rows of its axes, and its origin."""
    return [cells.GUIDE_FRAME(use.name, name) for name in (*(f"R{i}{j}" for i in range(3) for j in range(3)), *"xyz")]


def _wanted(system: System, tape: Tape, use: GuideUse) -> Stance:
    """Pose and velocity of a guide's path at the present time, in the world; the path is counted from the guided frame
    as it begins."""
    begun = [tape.read(name) for name in _begun(use)]
    R: Matrix = tuple(tuple(begun[i : i + 3]) for i in (0, 3, 6))  # type: ignore[assignment]
    place, moving, angles, turning = pose_and_rates(
        f"path of guide `{use.name}`",
        f"guides.{use.name}",
        use.courses,
        use.place,
        lambda path: system.value(path, tape.read),
        tape.time,
    )
    p = add((begun[9], begun[10], begun[11]), (place[0], place[1], place[2]))
    v = (moving[0], moving[1], moving[2])
    return Stance(product(rotation_rpy(*angles), R), p, rate_of_rpy(angles, turning), v)


def setpoint(system: System, actuator: Actuator, read: ReadCell, time: Real) -> Setpoint:
    """The setpoint of a joint at a time; kind "none" where it has no command."""
    if actuator.use.command is not None and actuator.use.command.guide:
        guide = next(use for use in system.structure.guides if use.name == actuator.use.command.guide)
        return _of_guide(system, actuator.use.joint, actuator.command_kind, guide, read, time)
    if actuator.profile is None:
        return Setpoint("none", 0.0, 0.0)
    value, slope = answer(actuator.owner, actuator.profile.course, course_values(system, actuator, read), time)
    return Setpoint(actuator.command_kind, value, slope)


def course_values(system: System, actuator: Actuator, read: ReadCell) -> NamedValues:
    """The parameters of the command that a servo has of its own, by name."""
    assert actuator.profile is not None
    return parameters(
        f"command `{actuator.profile.name}` of {actuator.owner}",
        f"{actuator.path}.command",
        actuator.profile.parameters,
        lambda path: system.value(path, read),
    )


def owner(use: GuideUse) -> str:
    """The guide's name for messages."""
    return f"guide `{use.name}` (model {use.model})"


def own(system: System, use: GuideUse, read: ReadCell) -> tuple[NamedValues, list[NamedValues]]:
    """The parameters of a guide, and those of each of its joints."""
    guide = models.find("guide", use.model, use.place)

    def values(head: str, declared: Iterable[Parameter]) -> NamedValues:
        return parameters(owner(use), head, declared, lambda path: system.value(path, read))

    joints = [values(f"guides.{use.name}.{joint}", guide.of_joint) for joint in use.joints]
    return values(f"guides.{use.name}", guide.parameters), joints


def _of_guide(system: System, joint: str, kind: str, use: GuideUse, read: ReadCell, time: Real) -> Setpoint:
    """The guide's setpoint of a joint at a time: between its ticks, the last rate, and the position to which that
    leads."""
    guide = models.find("guide", use.model, use.place)
    if guide.course is None:
        rate = read(cells.GUIDE_RATE(joint))
        if kind == "rate":
            return Setpoint(kind, rate, 0.0)
        return Setpoint(
            kind, read(cells.GUIDE_POSITION(joint)) + rate * (time - read(cells.GUIDE_TIME(use.name))), rate
        )
    p, joints = own(system, use, read)
    begins = [system.value(f"initial.{guided}.q", read) for guided in use.joints]
    value, slope = answer(owner(use), guide.course, p, joints, begins, time)[use.joints.index(joint)]
    return Setpoint(kind, value, slope)
