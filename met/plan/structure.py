"""Checks that the parts of a plan's structure fit together: arm, base, payloads, schedule, servos, records."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from met import models
from met.parameter import WORLD
from met.plan import BASE, COMPONENTS, ServoUse, Structure, relations
from met.plan.channel import COMMAND_UNIT, DIMENSIONS, channel_paths, channels
from met.plan.closing import ring
from met.plan.codec import Damaged
from met.plan.following import follows_itself
from met.plan.uses import quantities
from met.trace.nodes import TRUTHS

NAME = re.compile(r"[^\W\d]\w*")
"""A name in a deck: part of paths, messages and file names."""

MOST_TICKS = 10**12
"""Largest number of ticks of a run: thirty years at a kilohertz. It bounds divisors too."""


def check(structure: Structure, where: str) -> None:
    """Check all parts of a structure."""
    _check_arm(structure, where)
    _check_base(structure, where)
    _check_payloads(structure, f"{where}.payloads")
    _check_schedule(structure, where)
    _check_uses(structure, where)
    relations.check_guides(structure, where)
    _check_record(structure, f"{where}.record")


def check_name(text: str, where: str, before: Collection[str] = ()) -> None:
    """Check that a text is a name, and not among those before. Raises Damaged."""
    if not NAME.fullmatch(text):
        raise Damaged(where, f"{text!r} is no name: letters, digits and _")
    if text in before:
        raise Damaged(where, f"`{text}` is there twice")


def _check_names(parts: Sequence[Any], where: str, before: Collection[str] = ()) -> None:
    """Check that parts have names, which are neither one another's nor those before them."""
    names = [*before]
    for index, part in enumerate(parts):
        check_name(part.name, f"{where}[{index}].name", names)
        names.append(part.name)


def check_whole(number: int | None, low: int, high: int, where: str) -> None:
    if number is not None and not low <= number <= high:
        raise Damaged(where, f"it should be a whole number from {low} to {high}")


def _check_arm(structure: Structure, where: str) -> None:
    """Check that links and joints form a tree that stands on the base."""
    _check_names(structure.links, f"{where}.links")
    links = [link.name for link in structure.links]
    if not links:
        raise Damaged(f"{where}.links", "there is none")
    _check_names(structure.joints, f"{where}.joints")
    parents: dict[str, str] = {}
    for index, joint in enumerate(structure.joints):
        path = f"{where}.joints[{index}]"
        for end, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in (BASE, *links) or (end == "child" and name == BASE):
                raise Damaged(f"{path}.{end}", f"there is no link `{name}`")
        if joint.child in parents:
            raise Damaged(f"{path}.child", f"link `{joint.child}` is another joint's child already")
        parents[joint.child] = joint.parent
    for index, name in enumerate(links):
        if name not in parents and name != BASE:
            raise Damaged(f"{where}.links[{index}]", f"no joint holds link `{name}`")
    _check_followers(structure, f"{where}.joints")
    standing = {BASE}
    for joint_index, joint in enumerate(structure.joints):
        passed: set[str] = set()
        below = joint.child
        while below not in standing:
            if below in passed:
                raise Damaged(f"{where}.joints[{joint_index}].parent", f"link `{below}` hangs on itself")
            passed.add(below)
            below = parents[below]
        standing |= passed


def _check_followers(structure: Structure, where: str) -> None:
    """Check that joints follow moving joints, none of them itself by way of others, and that no servo drives them."""
    joints = {joint.name: joint for joint in structure.moving}
    for index, joint in enumerate(structure.joints):
        named = set(joint.follows)
        right = joint.name in joints and len(named) == len(joint.follows) and named <= set(joints)
        if joint.follows and (not right or follows_itself(joint.name, joints)):
            message = "it should follow moving joints, each once, of which none follows it"
            raise Damaged(f"{where}[{index}].follows", message)
    for index, joint in enumerate(structure.joints):
        if joint.loop is None:
            continue
        looped = {member.name for member, _ in ring(joint.loop, structure.joints)}
        if len(looped) != 3 or not {joint.name, *joint.follows} <= looped or joint.follows != (joint.loop.leader,):
            raise Damaged(f"{where}[{index}].loop", "it should close three moving joints, and one of them leads")
    servos = {use.joint: models.find("servo", use.model, use.place) for use in structure.servos}
    for index, joint in enumerate(structure.joints):
        if joint.follows and joint.name in servos and not servos[joint.name].is_passive:
            raise Damaged(f"{where}[{index}].follows", "its servo drives it")


def _check_base(structure: Structure, where: str) -> None:
    """Check that a moving base is a link, that what moves it in time is of its components, and that the base keeps its
    velocity products where it turns. Raises Damaged."""
    base, links = structure.base, [link.name for link in structure.links]
    if base is None:
        return
    if BASE not in links:
        raise Damaged(f"{where}.base", f"there is no link `{BASE}`, and it moves")
    if base.kind == "free" and base.courses:
        raise Damaged(f"{where}.base.courses", "a free base has none")
    relations.check_courses(base, COMPONENTS, f"{where}.base")
    if not structure.velocity_products and base.turns:
        raise Damaged(f"{where}.velocity_products", "a base that turns needs them")


def _check_payloads(structure: Structure, where: str) -> None:
    """Check that payloads have names of their own and links that carry them; their flight keeps the velocity
    products."""
    links = (BASE, *(link.name for link in structure.links))
    _check_names(structure.payloads, where, (WORLD, *links))
    for index, payload in enumerate(structure.payloads):
        if payload.link not in links:
            raise Damaged(f"{where}[{index}].link", f"there is no link `{payload.link}`")
    if not structure.velocity_products and any(payload.flies for payload in structure.payloads):
        raise Damaged(f"{where.rpartition('.')[0]}.velocity_products", "a payload that flies needs them")


def _check_schedule(structure: Structure, where: str) -> None:
    """Check that the base rate is above 0, and all divisors and tick counts are whole and in range. Raises Damaged."""
    schedule, path = structure.schedule, f"{where}.schedule"
    if not 0.0 < schedule.base_hz < math.inf:
        raise Damaged(f"{path}.base_hz", "it should be above 0, and finite")
    check_whole(schedule.ticks, 0, MOST_TICKS, f"{path}.ticks")
    check_whole(schedule.dynamics, 1, MOST_TICKS, f"{path}.dynamics")
    check_whole(schedule.record, 1, MOST_TICKS, f"{path}.record")
    for field in ("servos", "environment", "guides", "sensors"):
        for index, ticking in enumerate(getattr(structure, field)):
            check_whole(ticking.divisor, 1, MOST_TICKS, f"{where}.{field}[{index}].divisor")


def _check_uses(structure: Structure, where: str) -> None:
    """Check that servos are on moving joints, one each, with commands that they take, and that metrics are of existing
    channels."""
    kinds = {joint.name: joint.kind for joint in structure.joints}
    driven: set[str] = set()
    for index, use in enumerate(structure.servos):
        path = f"{where}.servos[{index}]"
        _moves(kinds, use.joint, path)
        if use.joint in driven:
            raise Damaged(f"{path}.joint", f"joint `{use.joint}` has a servo already")
        driven.add(use.joint)
        servo = models.find("servo", use.model, use.place)
        if use.command is None:
            if servo.commands:
                raise Damaged(f"{path}.command", f"a {use.model} needs one")
        elif use.command.kind not in servo.commands or use.command.kind not in COMMAND_UNIT:
            known = ", ".join(servo.commands) or "none"
            raise Damaged(f"{path}.command.kind", f"{use.model} takes no command `{use.command.kind}`, but {known}")
        if unknown := [name for name, _ in use.words if name not in servo.deciding]:
            raise Damaged(f"{path}.words", f"no part of a {use.model} depends on a word `{unknown[0]}`")
        if use.continuous and (servo.control is None or servo.clocked):
            raise Damaged(f"{path}.continuous", f"a {use.model} has no continuous law")
        _check_sensors(use, path)
        if use.continuous and use.divisor != structure.schedule.dynamics:
            raise Damaged(f"{path}.divisor", "of a continuous law it should be that of the dynamics")
    _check_names(structure.environment, f"{where}.environment")
    _check_names(structure.guides, f"{where}.guides")
    _check_link_sensors(structure, f"{where}.sensors")
    _check_expressions(structure, f"{where}.expressions")
    _check_names(structure.metrics, f"{where}.metrics")
    known_channels = channels(structure) if structure.metrics else {}
    for index, metric in enumerate(structure.metrics):
        if metric.of not in known_channels:
            raise Damaged(f"{where}.metrics[{index}].of", f"there is no channel `{metric.of}`")
    models.find("integrator", structure.integrator)
    _check_substitutions(structure, where)


def _check_expressions(structure: Structure, where: str) -> None:
    """Check that expressions are computed from existing channels, and have names of their own and one output."""
    known = channels(replace(structure, expressions=())) if structure.expressions else {}
    names: list[str] = []
    for index, expression in enumerate(structure.expressions):
        path = f"{where}[{index}]"
        if expression.name in known or expression.name in names:
            raise Damaged(f"{path}.name", f"there is a channel `{expression.name}` already")
        names.append(expression.name)
        if not expression.channels:
            raise Damaged(f"{path}.formula", "it is computed of no channel")
        for channel in expression.channels:
            if channel not in known:
                raise Damaged(f"{path}.formula", f"there is no channel `{channel}`")
        if (
            len(expression.formula.outputs) != 1
            or expression.formula.nodes[expression.formula.outputs[0] >> 1][0] in TRUTHS
        ):
            raise Damaged(f"{path}.formula", "it should have one output, a number")


def _check_sensors(use: ServoUse, path: str) -> None:
    """Check that sensors are of existing quantities that the law can see, one each."""
    if use.sensors and models.find("servo", use.model, use.place).control is None:
        raise Damaged(f"{path}.sensors", f"a {use.model} has no law that would see them")
    seen: set[str] = set()
    for index, sensor in enumerate(use.sensors):
        where = f"{path}.sensors[{index}]"
        if sensor.of not in quantities(use) or sensor.of in seen:
            raise Damaged(f"{where}.of", f"there is no `{sensor.of}` to be sensed, or it has a sensor already")
        if models.find("sensor", sensor.model, sensor.place).measures is not None:
            raise Damaged(f"{where}.model", f"`{sensor.model}` is a sensor of a link: it stands in a run")
        seen.add(sensor.of)
        if use.continuous and models.find("sensor", sensor.model, sensor.place).clocked:
            raise Damaged(f"{where}.model", f"a {sensor.model} reads at ticks, and the law is continuous")


def _check_link_sensors(structure: Structure, where: str) -> None:
    """Check that sensors of links have names of their own, models that measure a quantity of a link, and ticks at
    instants."""
    _check_names(structure.sensors, where)
    for index, use in enumerate(structure.sensors):
        path = f"{where}[{index}]"
        model = models.find("sensor", use.model, use.place)
        if model.measures is None:
            raise Damaged(f"{path}.model", f"`{use.model}` is a sensor of a joint: it stands in a servo")
        words = [parameter.name for parameter in model.parameters if parameter.shape == "word" and not parameter.names]
        if unknown := [name for name, _ in use.words if name not in words]:
            raise Damaged(f"{path}.words", f"`{use.model}` has no word `{unknown[0]}`")
        step = structure.schedule.dynamics
        if use.divisor % step:
            raise Damaged(f"{path}.divisor", f"it should be a multiple of that of the dynamics, {step}")


def _moves(kinds: Mapping[str, str], joint: str, path: str) -> None:
    """Check that a joint exists and moves."""
    if joint not in kinds:
        raise Damaged(f"{path}.joint", f"there is no joint `{joint}`")
    if kinds[joint] == "fixed":
        raise Damaged(f"{path}.joint", f"joint `{joint}` is fixed")


def _check_substitutions(structure: Structure, where: str) -> None:
    """Check that joints whose motors are on beds exist, once each, and have one law and servos that tick at the same
    instants. Raises Damaged."""
    kinds = {joint.name: joint.kind for joint in structure.joints}
    servos = {use.joint: use for use in structure.servos}
    on_beds: set[str] = set()
    for index, use in enumerate(structure.substitutions):
        path = f"{where}.substitutions[{index}]"
        _moves(kinds, use.joint, path)
        if use.joint not in servos:
            raise Damaged(f"{path}.joint", f"joint `{use.joint}` has no servo")
        if use.joint in on_beds:
            raise Damaged(f"{path}.joint", f"joint `{use.joint}` is on a bed already")
        on_beds.add(use.joint)
        servo = servos[use.joint]
        if not models.has_motor(models.find("servo", servo.model, servo.place)):
            raise Damaged(f"{path}.joint", f"the servo of joint `{use.joint}`, {servo.model}, has no motor for a bed")
        only = models.find("servo", servo.model, servo.place).motor_only
        if only is not None and dict(servo.words).get(only[0], only[1][0]) not in only[1]:
            message = f"the servo of joint `{use.joint}` has another `{only[0]}` than {only[1][0]}"
            raise Damaged(f"{path}.joint", message)
        for kind in ("bed", "law"):
            models.find(kind, getattr(use, kind), use.place)
        first = structure.substitutions[0]
        if use.law != first.law:
            raise Damaged(f"{path}.law", f"it should be {first.law}, that of the first substituted joint")
        if servo.continuous:
            raise Damaged(f"{path}.joint", f"the servo of joint `{use.joint}` is continuous: a bed's has a rate")
        if servo.sensors:
            raise Damaged(f"{path}.joint", f"the servo of joint `{use.joint}` has sensors: on a bed they are the bed's")
        if servo.divisor != servos[first.joint].divisor:
            message = f"the servo of joint `{use.joint}` should tick with that of `{first.joint}`, the first on a bed"
            raise Damaged(f"{path}.joint", message)


def _check_record(structure: Structure, where: str) -> None:
    """Check that each recorded signal is there once, and has channels, joints, components and units that go together.
    Raises Damaged."""
    known = channels(structure) if structure.record else {}
    names: list[str] = []
    for index, recorded in enumerate(structure.record):
        path = f"{where}[{index}]"
        if recorded.name in names:
            raise Damaged(f"{path}.name", f"`{recorded.name}` is there twice")
        names.append(recorded.name)
        for channel in recorded.channels:
            if channel not in known:
                raise Damaged(f"{path}.channels", f"there is no channel `{channel}`")
        if len(set(recorded.joints)) < len(recorded.joints):
            raise Damaged(f"{path}.joints", "a joint is there twice")
        if recorded.components and recorded.components not in DIMENSIONS:
            listed = " or ".join(", ".join(names) for names in DIMENSIONS)
            raise Damaged(f"{path}.components", f"it should be {listed}")
        wanted = channel_paths(recorded.name, recorded.joints, recorded.components)
        if recorded.channels != wanted:
            raise Damaged(f"{path}.channels", f"`{recorded.name}` of these joints is {', '.join(wanted)}")
        if len(recorded.unit) not in (1, len(recorded.channels)):
            raise Damaged(f"{path}.unit", "it should be one unit, or one a channel")
