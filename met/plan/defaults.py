"""Parameters that an experiment needs, by the declarations of its models, and the defaults of missing ones."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

from met import models
from met.diagnostic import Place, nearest
from met.parameter import Parameter, is_present, under
from met.plan import COMPONENTS, Course, Experiment, Joint, Origin, Quantity, Structure
from met.plan.channel import JOINT_LIMITS, channels, joint_unit, ratio_unit, watched_unit
from met.plan.closing import of_joints
from met.plan.uses import model_uses, quantities, sensor_parts, servo_parts
from met.substitution import bed_scale

INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")

OF_FREE_BASE = (("position", "m"), ("rpy", "rad"), ("velocity", "m/s"), ("rate", "rad/s"))
"""Vectors of the initial state of a free base, with units; world axes."""

OF_FLIGHT = (("position", "m"), ("attitude", "rad"), ("velocity", "m/s"), ("rate", "rad/s"))
"""Vectors of the initial state of a payload that flies first, with units; world axes."""


def missing_parameters(experiment: Experiment) -> Iterator[tuple[str, Quantity | None]]:
    """Paths of parameters that the experiment lacks, each with its model's default or the servo's value, None where
    there is neither. A motor bed of another size (`scale`) takes no values of its servo."""
    defaults: dict[str, Quantity] = {}
    scaled = {use.joint for use in experiment.structure.substitutions if use.scaled}
    for path, unit, default, parameter in declared(experiment):
        if path in experiment.parameters or (parameter is not None and parameter.timing):
            continue
        default_quantity = (
            None if default is None else Quantity(default, unit, Origin("default", note="not in the plan file"))
        )
        joint = path.partition(".")[0]
        if default_quantity is None and parameter is not None and parameter.of_servo and joint not in scaled:
            of_servo = f"{joint}.servo.{parameter.of_servo}"
            default_quantity = experiment.parameters.get(of_servo, defaults.get(of_servo))
        if default_quantity is not None:
            defaults[path] = default_quantity
        yield path, default_quantity


def unknown_parameters(experiment: Experiment) -> Iterator[tuple[str, str | None]]:
    """Paths under a model of the experiment that are not in its declaration, with the nearest declared one."""
    structure = experiment.structure
    known = {path for path, *_ in declared(experiment)}
    heads = heads_of_models(structure)
    for path in experiment.parameters:
        if path not in known and path.startswith(heads):
            yield path, nearest(path, known, cutoff=0.8)


def heads_of_models(structure: Structure) -> tuple[str, ...]:
    """Prefixes of the paths of parameters that a model of the structure declares."""
    return tuple(f"{use.head}." for use in model_uses(structure) if use.head)


Declared = tuple[str, str, float | tuple[float, ...] | str | None, Parameter | None]
"""Path, SI unit and default of a parameter, and its model's declaration; None for the arm's own."""


def of_environment(experiment: Experiment) -> Iterator[tuple[str, tuple[Parameter, ...]]]:
    """The prefix of the paths of each environment model's parameters, with the declarations of those that are there."""
    held = experiment.parameters
    for use in experiment.structure.environment:
        prefix, declared = f"environment.{use.name}", models.find("environment", use.model, use.place).parameters
        words = {
            parameter.name: str(held[path].value)
            for parameter in declared
            if (path := f"{prefix}.{parameter.name}") in held
        }
        yield prefix, tuple(parameter for parameter in declared if is_present(parameter, words))


def timing_defaults(experiment: Experiment) -> dict[str, Quantity]:
    """The numbers with which all environment models act always and in full, and metrics watch the whole run
    (`Parameter.timing`), by path."""
    metrics = experiment.structure.metrics
    watching = ((f"metrics.{use.name}", models.find("metric", use.model, use.place).parameters) for use in metrics)
    return {
        f"{prefix}.{parameter.name}": Quantity(parameter.default, parameter.unit, Origin("default"))
        for prefix, declared in (*of_environment(experiment), *watching)
        for parameter in declared
        if parameter.timing and parameter.default is not None
    }


def related(experiment: Experiment) -> Iterator[tuple[str, tuple[Parameter, ...]]]:
    """Parameters of environment models, guides and links' sensors, which may name parts of the arm or belong together:
    by prefix of their paths, as of `of_environment`."""
    structure = experiment.structure
    yield from of_environment(experiment)
    for sensor in structure.sensors:
        yield f"sensors.{sensor.name}", sensor_parts(sensor, "parameters")
    for use in structure.guides:
        yield f"guides.{use.name}", models.find("guide", use.model, use.place).parameters


def declared(experiment: Experiment) -> Iterator[Declared]:
    """Every parameter that an experiment of this structure has (head of `met.plan`)."""
    structure = experiment.structure
    for link in structure.links:
        yield f"links.{link.name}.mass", "kg", None, None
        for axis in "xyz":
            yield f"links.{link.name}.com.{axis}", "m", None, None
        for entry in INERTIA:
            yield f"links.{link.name}.inertia.{entry}", "kg*m^2", None, None
    yield from _of_payloads(structure)
    kinds = {joint.name: joint for joint in structure.joints}
    for joint in structure.joints:
        vectors = [("at", "m"), ("rpy", "rad"), *([] if joint.kind == "fixed" else [("axis", "1")])]
        for name, unit in vectors:
            for axis in "xyz":
                yield f"{joint.name}.{name}.{axis}", unit, None, None
    for joint in structure.moving:
        for limit in joint.limits:
            yield f"{joint.name}.{limit}", joint_unit(JOINT_LIMITS[limit], joint), None, None
        for leader, path in joint.ratio_paths.items():
            yield path, ratio_unit(joint.kind, kinds[leader].kind), None, None
        if joint.follows:
            yield f"{joint.name}.offset", joint_unit("joint", joint), None, None
        yield f"initial.{joint.name}.q", joint_unit("joint", joint), None, None
        yield f"initial.{joint.name}.qd", joint_unit("joint/s", joint), None, None
    for name, point, axis in itertools.product(of_joints(structure.joints), ("at", "to_at"), "xyz"):
        yield f"{name}.{point}.{axis}", "m", None, None
    yield from _of_base(structure)
    for use in structure.servos:
        joint = kinds[use.joint]
        for parameter in servo_parts(use).parameters:
            held = parameter if use.command is None else under(parameter, use.command.kind)
            yield from _numbers(f"{use.joint}.servo", held, joint_unit(parameter.unit, joint))
        for sensor in use.sensors:
            watched_unit_of = joint_unit(quantities(use)[sensor.of], joint)
            head = f"{use.joint}.servo.sensor.{sensor.of}"
            for parameter in sensor_parts(sensor, "parameters"):
                yield from _numbers(head, parameter, watched_unit(parameter.unit, watched_unit_of))
        if use.command is not None and not use.command.guide:
            for parameter in models.find("command", use.command.model, use.place).parameters:
                unit = joint_unit(parameter.unit, joint, use.command.kind)
                yield from _numbers(f"{use.joint}.servo.command", parameter, unit)
    for on_bed in structure.substitutions:
        joint = kinds[on_bed.joint]
        for head, model in (
            ("bed", models.find("bed", on_bed.bed, on_bed.place)),
            ("law", models.find("law", on_bed.law, on_bed.place)),
        ):
            for parameter in model.parameters:
                if parameter.shape != "text":  # for the compiler alone
                    yield from _numbers(f"{on_bed.joint}.{head}", parameter, joint_unit(parameter.unit, joint))
        for parameter in bed_scale.PARAMETERS if on_bed.scaled else ():
            yield from _numbers(f"{on_bed.joint}.bed.scale", parameter, parameter.unit)
    for prefix, parameters in of_environment(experiment):
        named = next((f"{prefix}.{parameter.name}" for parameter in parameters if parameter.names == "joint"), None)
        about = experiment.parameters.get(named) if named is not None else None
        on = kinds.get(str(about.value)) if about is not None else None
        for parameter in parameters:
            yield from _numbers(prefix, parameter, parameter.unit if on is None else joint_unit(parameter.unit, on))
    yield from _of_guides(structure)
    for on_link in structure.sensors:
        unit = models.find("sensor", on_link.model, on_link.place).unit
        for parameter in sensor_parts(on_link, "parameters"):
            yield from _numbers(f"sensors.{on_link.name}", parameter, watched_unit(parameter.unit, unit))
    watched = channels(structure) if structure.metrics else {}
    for metric in structure.metrics:
        watched_unit_of = watched[metric.of].unit if metric.of in watched else "1"
        for parameter in models.find("metric", metric.model, metric.place).parameters:
            yield from _numbers(f"metrics.{metric.name}", parameter, watched_unit(parameter.unit, watched_unit_of))


def _of_payloads(structure: Structure) -> Iterator[Declared]:
    """Declared parameters of the payloads: mass, inertia, place, and times of grapple and release."""
    for payload in structure.payloads:
        head = f"payloads.{payload.name}"
        yield f"{head}.mass", "kg", None, None
        for entry in INERTIA:
            yield f"{head}.inertia.{entry}", "kg*m^2", None, None
        held = () if payload.grappled else (("rpy", "rad"),)
        for name, unit in (("com", "m"), ("at", "m"), *held, *(OF_FLIGHT if payload.grappled else ())):
            for axis in "xyz":
                yield f"{head}.{name}.{axis}", unit, None, None
        for name in ("grapple",) * payload.grappled + ("release",) * payload.released:
            yield f"{head}.{name}", "s", None, None


def _of_base(structure: Structure) -> Iterator[Declared]:
    """Declared parameters of a base that moves: its initial state, or the commands that move its components in time."""
    if structure.free:
        for name, unit in OF_FREE_BASE:
            for axis in "xyz":
                yield f"initial.base.{name}.{axis}", unit, None, None
    if structure.base is not None:
        yield from _of_courses("base", structure.base.courses, structure.base.place)


def _of_guides(structure: Structure) -> Iterator[Declared]:
    """Declared parameters of the guides: their own, those of each joint, and those of the commands that move their
    paths' components in time."""
    kinds = {joint.name: joint for joint in structure.joints}
    for use in structure.guides:
        head, guide = f"guides.{use.name}", models.find("guide", use.model, use.place)
        for parameter in guide.parameters:
            yield from _numbers(head, parameter, parameter.unit)
        for joint in use.joints:
            for parameter in guide.of_joint:
                yield from _numbers(f"{head}.{joint}", parameter, joint_unit(parameter.unit, kinds[joint]))
        yield from _of_courses(head, use.courses, use.place)


def _of_courses(head: str, courses: Iterable[Course], place: Place | None) -> Iterator[Declared]:
    """Declared parameters of the commands that move a base's or path's components in time. head: of their paths"""
    for course in courses:
        for parameter in models.find("command", course.model, place).parameters:
            unit = joint_unit(parameter.unit, component(course.component), "position")
            yield from _numbers(f"{head}.{course.component}", parameter, unit)


def component(name: str) -> Joint:
    """A joint that moves along or about a component of a pose, by which its units are found."""
    kind = "prismatic" if COMPONENTS.index(name) < 3 else "revolute"
    return Joint(name, kind, "", "")  # type: ignore[arg-type]


def _numbers(prefix: str, parameter: Parameter, unit: str) -> Iterator[Declared]:
    """The scalar parameters of a declaration: a vector has three, `.x .y .z`, everything else one."""
    path = f"{prefix}.{parameter.name}"
    if parameter.shape != "vector":
        yield path, unit, parameter.default, parameter
        return
    for index, axis in enumerate("xyz"):
        default = parameter.default[index] if isinstance(parameter.default, tuple) else None
        yield f"{path}.{axis}", unit, default, parameter
