"""Chains of a large arm that do not act on each other, each as an experiment of its own.

Chains on a fixed base are coupled only by payloads, guides, sensors of links and models of the environment that concern
several of them. Without these a chain alone moves as it does in the whole arm, up to rounding, and an input with an
effect on a chain has one on the whole. Chains are analysed apart because the work grows faster than the number of
joints.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from operator import itemgetter

from met.plan import BASE, Experiment, Formula, Quantity, Structure
from met.trace.graph import Formulas

MANY_JOINTS = 50
"""Number of moving joints from which on an arm is analysed chain by chain."""

APART = ("gravity",)
"""Models of the environment that act on each link without regard to the others."""


def chains(experiment: Experiment) -> tuple[Experiment, ...]:
    """The chains, each with its servos and parameters and all coordinates, without metrics and records; none where the
    arm is small, has one chain, or chains may act on each other."""
    structure = experiment.structure
    if len(structure.moving) < MANY_JOINTS or not _are_apart(structure):
        return ()
    by_branch = tuple(_reduced(experiment, joints) for joints in _branches(structure))
    divisors = {use.divisor for use in structure.servos}  # with others a frame of computers would be shorter
    if len(by_branch) < 2 or any({use.divisor for use in chain.structure.servos} != divisors for chain in by_branch):
        return ()
    return by_branch


def ticks_and_steps(structure: Structure) -> int:
    """The number of ticks of servos, and of steps, until all of these coincide again."""
    divisors = [structure.schedule.dynamics, *(use.divisor for use in structure.servos)]
    return sum(math.lcm(*divisors) // divisor for divisor in divisors)


def numbered(chain: Experiment) -> tuple[Experiment, Mapping[str, str]]:
    """The chain with its joints and links renamed to numbers, so that equal chains give equal experiments; and the
    joints' names by these numbers."""
    structure = chain.structure
    joints = {joint.name: str(number) for number, joint in enumerate(structure.joints)}
    links = {link.name: str(number) for number, link in enumerate(structure.links)} | {BASE: BASE}

    def path_of(path: str) -> str:
        """A parameter's path with the numbered names of its joint or link."""
        head, *rest = path.split(".")
        if head in ("links", "initial"):
            return ".".join([head, (links if head == "links" else joints)[rest[0]], *rest[1:]])
        return ".".join([joints.get(head, head), *rest])

    renamed = sorted(((path_of(path), value) for path, value in chain.parameters.items()), key=itemgetter(0))
    parameters, outputs = dict[str, Quantity](), list[int]()
    for path, quantity in renamed:
        if isinstance(quantity.value, Formula):
            outputs.append(chain.formulas.outputs[quantity.value.output])
            quantity = replace(quantity, value=Formula(len(outputs) - 1))
        parameters[path] = quantity
    renumbered = replace(
        structure,
        links=tuple(replace(link, name=links[link.name]) for link in structure.links),
        joints=tuple(
            replace(joint, name=joints[joint.name], parent=links[joint.parent], child=links[joint.child])
            for joint in structure.joints
        ),
        servos=tuple(replace(servo, joint=joints[servo.joint]) for servo in structure.servos),
    )
    formulas = Formulas(chain.formulas.inputs, chain.formulas.nodes, tuple(outputs))
    renamed_chain = replace(chain, structure=renumbered, parameters=parameters, formulas=formulas)
    return renamed_chain, {number: name for name, number in joints.items()}


def _are_apart(structure: Structure) -> bool:
    """True if nothing in the structure acts between joints other than through their own chain, so that its chains can
    be simulated alone."""
    names = [*(joint.name for joint in structure.joints), *(link.name for link in structure.links)]
    between = (structure.base, structure.payloads, structure.guides, structure.sensors, structure.substitutions)
    return (
        not any(between)
        and not structure.balanced
        and all(use.model in APART for use in structure.environment)
        and not any("." in name for name in names)
    )


def _branches(structure: Structure) -> Iterator[frozenset[str]]:
    """The joints of each chain that moves, by name, in the order of their first joints."""
    outward: dict[str, list[str]] = {}
    children = {joint.name: joint.child for joint in structure.joints}
    for joint in structure.joints:
        outward.setdefault(joint.parent, []).append(joint.name)
    moving = {joint.name for joint in structure.moving}
    for first in outward.get(BASE, ()):
        reached, waiting = set[str](), [first]
        while waiting:
            name = waiting.pop()
            reached.add(name)
            waiting += outward.get(children[name], ())
        if reached & moving:
            yield frozenset(reached)


def _reduced(experiment: Experiment, joints: frozenset[str]) -> Experiment:
    """The experiment with these joints and the links that they carry alone, without metrics and records."""
    structure = experiment.structure
    every = {joint.name for joint in structure.joints}
    links = {joint.child for joint in structure.joints if joint.name in joints} | {BASE}

    def is_of_it(path: str) -> bool:
        """True if a parameter belongs to the chain, or to no joint or link."""
        head, *rest = path.split(".")
        if head in ("links", "initial"):
            return rest[0] in (links if head == "links" else joints)
        return head != "metrics" and (head not in every or head in joints)

    return replace(
        experiment,
        structure=replace(
            structure,
            links=tuple(link for link in structure.links if link.name in links),
            joints=tuple(joint for joint in structure.joints if joint.name in joints),
            servos=tuple(servo for servo in structure.servos if servo.joint in joints),
            metrics=(),
            record=(),
            expressions=(),
        ),
        parameters={path: value for path, value in experiment.parameters.items() if is_of_it(path)},
    )
