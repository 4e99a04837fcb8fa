"""The setpoints of servos, from their own commands or from the guides that command their joints."""

from __future__ import annotations

from collections.abc import Iterable

from met import models
from met.parameter import Parameter
from met.plan import GuideUse
from met.program import cells
from met.program.system import Actuator, ReadCell, System
from met.program.values import NamedValues, answer, parameters
from met.servos.servo import Setpoint
from met.trace import Real


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
    """The parameters of the course of a servo's own command."""
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
    """The guide's parameters, and those of each of its joints."""
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
