"""Checks of parameters against each other, and of guides, by declarations; the compiler makes the same for decks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from met import models
from met.parameter import WORLD, Parameter
from met.plan import COMPONENTS, Base, Experiment, Formula, GuideUse, ServoUse, Structure
from met.plan.channel import carries
from met.plan.codec import Damaged

Holds = Callable[[np.ndarray], np.ndarray]
"""A test of values [case, k] that returns a truth for each case, [case]."""


def check_uses(experiment: Experiment, uses: Iterable[tuple[str, tuple[Parameter, ...]]], where: str) -> None:
    """Raise Damaged where words name no part of the arm, where lists do not match, or where a parameter that decides
    the program varies.

    uses  what paths begin with, and the declarations
    """
    for prefix, parameters in uses:
        for parameter in parameters:
            path = f"{prefix}.{parameter.name}"
            quantity = experiment.parameters.get(path)
            if quantity is None:
                continue  # missing: E304
            if parameter.decides and isinstance(quantity.value, Formula):
                raise Damaged(f"{where}.{path}.value", "it decides the program, so it should be a number")
            if parameter.names and quantity.value not in named(experiment.structure, parameter):
                raise Damaged(f"{where}.{path}.value", f"it should name one of the arm's {parameter.names}s")
            links = [link.name for link in experiment.structure.links]
            if parameter.names and quantity.value == WORLD and WORLD in links:
                raise Damaged(f"{where}.{path}.value", "a link has this name, which is the ground's")
            if isinstance(quantity.value, tuple):
                _check_list(experiment, prefix, parameter, quantity.value, f"{where}.{path}")


def named(structure: Structure, parameter: Parameter) -> tuple[str, ...]:
    """The words that are allowed for a parameter which names a part of the arm."""
    bodies = (*(link.name for link in structure.links), *(payload.name for payload in structure.payloads))
    of_arm = bodies if parameter.names == "link" else tuple(joint.name for joint in structure.moving)
    return (*of_arm, *parameter.words)


def tests(
    experiment: Experiment, uses: Iterable[tuple[str, tuple[Parameter, ...]]]
) -> Iterator[tuple[str, list[str], Holds, str]]:
    """Conditions on numbers in every case: path, the numbers' paths, the test, and the message where it fails."""
    for prefix, parameters in uses:
        for parameter in parameters:
            path = f"{prefix}.{parameter.name}"
            if parameter.direction:
                yield path, [f"{path}.{axis}" for axis in "xyz"], _is_direction, "it has no direction"
            if parameter.less_than:
                other = f"{prefix}.{parameter.less_than}"
                yield path, [path, other], is_less, f"it should be less than `{parameter.less_than}`"


def _check_list(
    experiment: Experiment, prefix: str, parameter: Parameter, numbers: tuple[Any, ...], where: str
) -> None:
    """Check that a list parameter has as many numbers as the other list it goes with, and rises where it must. Raises
    Damaged."""
    if parameter.as_many_as and (numbers or parameter.default is None):
        other = experiment.parameters.get(f"{prefix}.{parameter.as_many_as}")
        if other is not None and isinstance(other.value, tuple) and len(other.value) != len(numbers):
            raise Damaged(where, f"there are {len(numbers)} for {len(other.value)} of `{parameter.as_many_as}`")
    if parameter.rises and not numbers and parameter.default is None:
        raise Damaged(where, "there are none")
    if parameter.rises and not all(before < after for before, after in itertools.pairwise(numbers)):
        raise Damaged(where, "they do not rise")


def _is_direction(values: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore", under="ignore"):
        size = (values * values).sum(axis=1)
    return np.asarray((size > 0.0) & (size < math.inf))


def is_less(values: np.ndarray) -> np.ndarray:
    """True for the cases, [case, 2], whose first number is below the second."""
    return np.asarray(values[:, 0] < values[:, 1])


def check_guides(structure: Structure, where: str) -> None:
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
    """Check that the commands that move a path or a base in time are of its components, in their order, and of models
    that there are. Raises Damaged."""
    known = list(components)
    for index, course in enumerate(use.courses):
        if course.component not in known:
            listed = f"it should be one of {', '.join(components)}, in this order"
            raise Damaged(f"{path}.courses[{index}].component", listed if components else "this guide has no path")
        known = known[known.index(course.component) + 1 :]
        models.find("command", course.model, use.place)


def check_guided_paths(experiment: Experiment, where: str) -> None:
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


Test = tuple[str, list[str], Callable[[np.ndarray], np.ndarray], str]
"""Path at fault, paths of the numbers to test, the test (values [case, path] -> [case]), and the message where it
fails."""


def rest_tests(experiment: Experiment) -> list[Test]:
    """One test for each joint that its servo may require at rest."""
    return [
        _test(experiment, use)
        for use in experiment.structure.servos
        if models.find("servo", use.model, use.place).at_rest is not None
    ]


def _test(experiment: Experiment, use: ServoUse) -> Test:
    """The test that a servo which cannot move a joint at the start begins at rest: the tested path, the paths it reads,
    a function of their values [case, path], and the message."""
    servo, rate = models.find("servo", use.model, use.place), f"initial.{use.joint}.qd"
    head = f"{use.joint}.servo."
    numbers = {
        path.removeprefix(head): path
        for path, quantity in experiment.parameters.items()
        if path.startswith(head) and not isinstance(quantity.value, str | tuple)
    }

    def holds(values: np.ndarray) -> np.ndarray:
        p = SimpleNamespace(**{name: values[:, i] for i, name in enumerate(numbers, 1)})
        return np.asarray(np.logical_not(servo.at_rest(p)) | (values[:, 0] == 0.0))

    message = f"a {use.model} joint begins at rest"
    return rate, [rate, *numbers.values()], holds, message
