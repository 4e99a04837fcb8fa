"""The models of an experiment as it uses them: the parts present under its words, and their packages."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from met import models
from met.host.entry_points import offered
from met.parameter import is_present
from met.plan import LinkSensor, SensorUse, ServoUse, Structure

if TYPE_CHECKING:
    from met.servos.servo import Parts


def quantities(use: ServoUse) -> dict[str, str]:
    """Quantities that a sensor of this servo may read, with declared units: the joint's motion, the servo's states."""
    return {"q": "joint", "qd": "joint/s", **{state.name: state.unit for state in servo_parts(use).natural}}


def sensor_parts(use: SensorUse | LinkSensor, group: str) -> tuple[Any, ...]:
    """The parts of a sensor's `parameters`, `states` or `memory` that are present under this use's words."""
    sensor = models.find("sensor", use.model, use.place)
    defaults = {
        parameter.name: parameter.default for parameter in sensor.parameters if isinstance(parameter.default, str)
    }
    return tuple(part for part in getattr(sensor, group) if is_present(part, defaults | dict(use.words)))


def servo_parts(use: ServoUse) -> Parts:
    """The parts of a servo that are present in this use of it."""
    from met.servos.servo import parts

    return parts(models.find("servo", use.model, use.place), dict(use.words), continuous=use.continuous)


def packages(structures: Iterable[Structure]) -> tuple[str, ...]:
    """The other packages whose models these structures use, by name."""
    used: dict[models.Kind, set[str]] = {kind: set() for kind in models.GROUPS}
    for structure in structures:
        used["servo"] |= {servo.model for servo in structure.servos}
        used["sensor"] |= {sensor.model for servo in structure.servos for sensor in servo.sensors}
        used["sensor"] |= {sensor.model for sensor in structure.sensors}
        commands = [servo.command for servo in structure.servos if servo.command is not None]
        used["command"] |= {command.model for command in commands if not command.guide}
        used["command"] |= {
            course.model for use in (structure.base, *structure.guides) if use for course in use.courses
        }
        used["environment"] |= {use.model for use in structure.environment}
        used["guide"] |= {use.model for use in structure.guides}
        used["metric"] |= {use.model for use in structure.metrics}
        used["integrator"].add(structure.integrator)
        used["bed"] |= {use.bed for use in structure.substitutions}
        used["law"] |= {use.law for use in structure.substitutions}
    used_packages = set()
    for kind, names in used.items():
        if theirs := names - models.find_own(kind).keys():
            used_packages |= {
                point.package for point in offered(models.GROUPS[kind].entry_points) if point.name in theirs
            }
    return tuple(sorted(used_packages))
