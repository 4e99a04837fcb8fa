"""Checks of a plan's guides, against their declarations and the servos that follow them."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from met import models
from met.plan import COMPONENTS, Base, Experiment, GuideUse, Structure
from met.plan.channel import carries
from met.plan.codec import Damaged


def check(structure: Structure, where: str) -> None:
    """Check that guides and servos name each other, ticks are at instants, and courses are those of components. Raises
    Damaged."""
    for index, use in enumerate(structure.guides):
        path = f"{where}.guides[{index}]"
        guide = models.find("guide", use.model, use.place)
        follow = tuple(
            servo.joint
            for joint in structure.moving
            for servo in structure.servos
            if servo.joint == joint.name and servo.command is not None and servo.command.guide == use.name
        )
        if use.joints != follow or not follow:
            listed = ", ".join(follow) or "none"
            raise Damaged(f"{path}.joints", f"it should be those whose servos follow it, in the arm's order: {listed}")
        step = structure.schedule.dynamics
        if guide.steer is None and use.divisor != step:
            raise Damaged(f"{path}.divisor", "of a guide that does not tick it should be that of the dynamics")
        if use.divisor % step:
            raise Damaged(f"{path}.divisor", f"it should be a multiple of that of the dynamics, {step}")
        check_courses(use, COMPONENTS if guide.components is not None else (), path)
    for index, servo in enumerate(structure.servos):
        command, path = servo.command, f"{where}.servos[{index}].command"
        if command is None or not command.guide:
            continue
        use_of = {use.name: use for use in structure.guides}.get(command.guide)
        if use_of is None:
            raise Damaged(f"{path}.guide", f"there is no guide `{command.guide}`")
        taken = models.find("guide", use_of.model, use_of.place).commands
        if command.kind not in taken:
            raise Damaged(f"{path}.kind", f"a {use_of.model} gives no command `{command.kind}`, but {', '.join(taken)}")
        if command.model:
            raise Damaged(f"{path}.model", "a command that follows a guide has none")


def check_courses(use: Base | GuideUse, components: Sequence[str], path: str) -> None:
    """Check that courses are those of components, in their order, and that there are their models."""
    known = list(components)
    for index, course in enumerate(use.courses):
        if course.component not in known:
            listed = f"it should be one of {', '.join(components)}, in this order"
            raise Damaged(f"{path}.courses[{index}].component", listed if components else "this guide has no path")
        known = known[known.index(course.component) + 1 :]
        models.find("command", course.model, use.place)


def check_paths(experiment: Experiment, where: str) -> None:
    """Raise Damaged unless the joints of each guide carry its link, and are at least as many as the guided
    components."""
    structure = experiment.structure
    for use in structure.guides:
        guided = guided_components(experiment, use)
        if guided is None:
            continue  # missing: E304
        link, components = guided
        for course in use.courses:
            if course.component not in components:
                raise Damaged(f"{where}.guides.{use.name}.{course.component}", "this component is not guided")
        for joint in use.joints:
            if not carries(structure, link, joint):
                raise Damaged(f"{where}.guides.{use.name}.link", f"joint `{joint}` does not carry link `{link}`")
        if len(use.joints) < len(components):
            message = f"there are {len(use.joints)} joints for {len(components)} components"
            raise Damaged(f"{where}.guides.{use.name}", message)


def guided_components(experiment: Experiment, use: GuideUse) -> tuple[str, tuple[str, ...]] | None:
    """The link and the components of a guide with a path; None for a guide without one, and where words are missing."""
    guide = models.find("guide", use.model, use.place)
    words: dict[str, Any] = {}
    for parameter in guide.parameters:
        quantity = experiment.parameters.get(f"guides.{use.name}.{parameter.name}")
        if parameter.shape == "word" and quantity is not None:
            words[parameter.name] = quantity.value
        elif parameter.shape == "word":
            return None
    return None if guide.components is None else (words["link"], guide.components(SimpleNamespace(**words)))
