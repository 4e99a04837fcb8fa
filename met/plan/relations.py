"""Checks of parameters against each other, as declarations require; the compiler makes the same ones for decks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from met.parameter import WORLD, Parameter
from met.plan import Experiment, Formula, Structure
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
                yield path, [path, other], _is_less, f"it should be less than `{parameter.less_than}`"


def _check_list(
    experiment: Experiment, prefix: str, parameter: Parameter, numbers: tuple[Any, ...], where: str
) -> None:
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


def _is_less(values: np.ndarray) -> np.ndarray:
    return np.asarray(values[:, 0] < values[:, 1])
