"""The models of an experiment as it uses them: the parts present under its words, and their packages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from met import models
from met.diagnostic import Place
from met.frozen import frozen
from met.host.entry_points import offered
from met.parameter import is_present
from met.plan import BASE, Base, GuideUse, LinkSensor, SensorUse, ServoUse, Structure

if TYPE_CHECKING:
    from met.servos.servo import Parts


@frozen
class ModelUse:
    """A model that a structure names.

    head   path of the thing that uses it, below which its parameters stand; "" of the integrator, which has none
    words  those of its parameters that the structure decides, where they are not the defaults: name and word
    """

    kind: models.Kind
    model: str
    head: str
    place: Place | None = None
    words: tuple[tuple[str, str], ...] = ()

    @property
    def declaration(self) -> Any:
        """The model's declaration. Raises Problem where there is no such model."""
        return models.find(self.kind, self.model, self.place)


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


def model_uses(structure: Structure) -> Iterator[ModelUse]:
    """Every model that a structure names. A head that begins with another one comes after it."""
    yield ModelUse("integrator", structure.integrator, "")
    for servo in structure.servos:
        head = f"{servo.joint}.servo"
        yield ModelUse("servo", servo.model, head, servo.place, servo.words)
        for sensor in servo.sensors:
            yield ModelUse("sensor", sensor.model, f"{head}.sensor.{sensor.of}", sensor.place, sensor.words)
        if servo.command is not None and not servo.command.guide:
            yield ModelUse("command", servo.command.model, f"{head}.command", servo.place)
    for on_bed in structure.substitutions:
        yield ModelUse("bed", on_bed.bed, f"{on_bed.joint}.bed", on_bed.place)
        yield ModelUse("law", on_bed.law, f"{on_bed.joint}.law", on_bed.place)
    if structure.base is not None:
        yield from _courses(BASE, structure.base)
    for environment in structure.environment:
        yield ModelUse("environment", environment.model, f"environment.{environment.name}", environment.place)
    for guide in structure.guides:
        yield ModelUse("guide", guide.model, f"guides.{guide.name}", guide.place)
        yield from _courses(f"guides.{guide.name}", guide)
    for on_link in structure.sensors:
        yield ModelUse("sensor", on_link.model, f"sensors.{on_link.name}", on_link.place, on_link.words)
    for metric in structure.metrics:
        yield ModelUse("metric", metric.model, f"metrics.{metric.name}", metric.place)


def _courses(head: str, path: Base | GuideUse) -> Iterator[ModelUse]:
    """The commands that move the components of a base or of a guide's path."""
    for course in path.courses:
        yield ModelUse("command", course.model, f"{head}.{course.component}", path.place)


def packages(structures: Iterable[Structure]) -> tuple[str, ...]:
    """The other packages whose models these structures use, by name."""
    used: dict[models.Kind, set[str]] = {kind: set() for kind in models.GROUPS}
    for structure in structures:
        for use in model_uses(structure):
            used[use.kind].add(use.model)
    used_packages = set()
    for kind, names in used.items():
        if theirs := names - models.find_own(kind).keys():
            used_packages |= {
                point.package for point in offered(models.GROUPS[kind].entry_points) if point.name in theirs
            }
    return tuple(sorted(used_packages))
