"""Limits that the models of a structure may reach, each by the path of the parameter that sets it.

    shoulder.servo.tau_max          of a servo: a memory or signal whose declaration names the parameter as its limit
    environment.end.upper           of an environment model, by its declaration (`Environment.limits`)
    shoulder.servo.command.times    of a command's course, likewise: beyond the ends of its table

    shoulder.q_max                  of a joint, by the deck: it is watched, and keeps the joint from nothing

A limit that is infinite in every case is not listed, and neither are the ends of a table of one row.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from met import models
from met.frozen import frozen
from met.parameter import Limit, Memory, Signal
from met.plan import Experiment, Quantity, Structure
from met.plan.channel import channels
from met.plan.uses import servo_parts


@frozen
class LimitUse:
    """A limit of a model in use.

    path      of the parameter that sets it
    joint     that it is of; "" where it is of none
    channels  of its servo, whose size never exceeds it; none of other models
    declared  of an environment model or a command's course; None of a servo
    owner     the name of the environment model in the deck; "" of others
    bound     name of a joint's own limit: `q_min`, `q_max`, `qd_max` or `tau_max`; "" of a model's
    machine   whether a machine stays within it, so that it cuts what a metric sees
    """

    path: str
    joint: str
    channels: tuple[str, ...] = ()
    declared: Limit | None = None
    owner: str = ""
    bound: str = ""
    machine: bool = True


def limits(structure: Structure, parameters: Mapping[str, Quantity]) -> tuple[LimitUse, ...]:
    """All limits that can be reached in a case: of joints, of their servos and commands, of environment models."""
    uses = (
        *_of_joints(structure),
        *_of_servos(structure),
        *_of_commands(structure),
        *_of_environment(structure, parameters),
    )
    return tuple(use for use in uses if _is_one(parameters.get(use.path)))


def extremes(experiment: Experiment) -> dict[str, tuple[LimitUse, ...]]:
    """The required metrics that state an extreme, by name, each with the machines' limits that may have cut it: those
    of its channel's joint, or all where the channel belongs to no joint."""
    required = {requirement.metric for requirement in experiment.requirements}
    known, uses = channels(experiment.structure), limits(experiment.structure, experiment.parameters)
    out = {}
    for use in experiment.structure.metrics:
        if use.name in required and models.find("metric", use.model, use.place).extreme:
            joint = known[use.of].joint
            if those := tuple(limit_use for limit_use in uses if limit_use.machine and joint in ("", limit_use.joint)):
                out[use.name] = those
    return out


def _is_one(quantity: Quantity | None) -> bool:
    """True if a parameter has a value that limits anything."""
    if quantity is None:
        return False
    value = quantity.value
    if isinstance(value, tuple):
        return len(value) > 1
    return not (isinstance(value, float | int) and math.isinf(value))


def _of_joints(structure: Structure) -> Iterator[LimitUse]:
    for joint in structure.moving:
        for name in joint.limits:
            yield LimitUse(f"{joint.name}.{name}", joint.name, bound=name, machine=False)


def _of_servos(structure: Structure) -> Iterator[LimitUse]:
    """The limits of servos, each with the channels that it limits."""
    for use in structure.servos:
        parts, path = servo_parts(use), f"{use.joint}.servo"
        declared: tuple[Memory | Signal, ...] = (*parts.outputs, *parts.signals)
        limited = [part for part in declared if part.limit]
        for name in dict.fromkeys(part.limit for part in limited):
            channels = tuple(f"{path}.{part.name}" for part in limited if part.limit == name)
            yield LimitUse(f"{path}.{name}", use.joint, channels)


def _of_commands(structure: Structure) -> Iterator[LimitUse]:
    """The limits that commands of servos may reach, such as a table's ends."""
    for use in structure.servos:
        if use.command is not None and not use.command.guide:
            for limit in models.find("command", use.command.model, use.place).limits:
                yield LimitUse(f"{use.joint}.servo.command.{limit.parameter}", use.joint, declared=limit, machine=False)


def _of_environment(structure: Structure, parameters: Mapping[str, Quantity]) -> Iterator[LimitUse]:
    """The limits that models of the environment may reach, each with its joint."""
    for use in structure.environment:
        model, path = models.find("environment", use.model, use.place), f"environment.{use.name}"
        named = next((parameter.name for parameter in model.parameters if parameter.names == "joint"), "")
        joint = parameters[f"{path}.{named}"].value if named and f"{path}.{named}" in parameters else ""
        for limit in model.limits:
            table = any(
                parameter.name == limit.parameter and parameter.shape == "list" for parameter in model.parameters
            )
            yield LimitUse(f"{path}.{limit.parameter}", str(joint), declared=limit, owner=use.name, machine=not table)
