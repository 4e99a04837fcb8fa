"""Warnings about distant grapples: a payload that flies where its link cannot be, however the joints turn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ic.meaning.definitions.merge import MergedBlock
from ic.meaning.parameters.scope import Scope
from met import models
from met.diagnostic import Place
from met.frozen import frozen
from met.plan import Experiment, Formula, Payload, Structure
from met.plan.chains import way_inward
from met.trace import Real

FAR = 1.5
"""Distance relative to the reach beyond which a grapple counts as distant."""


def check_reach(scope: Scope, block: MergedBlock, structure: Structure) -> None:
    """Warn about payloads that are grappled beyond the reach of their links: on a fixed base, with revolute joints."""
    items = {item.name: item for item in block.of_kind("payload")}
    for payload in structure.payloads:
        looked_at = grapple_numbers(structure, payload, scope.parameters)
        if looked_at is not None:
            item = items[payload.name]
            grapple = item.body.get("grapple") if item.body is not None else None
            _observe(scope, payload, looked_at, structure.schedule.duration, (grapple or item).value_place)


def flies_from_afar(experiment: Experiment, name: str) -> bool:
    """True where the check has warned (D339) that the payload of this name is grappled beyond its link's reach."""
    structure = experiment.structure
    payload = next((candidate for candidate in structure.payloads if candidate.name == name), None)
    looked_at = grapple_numbers(structure, payload, experiment.parameters) if payload is not None else None
    if looked_at is None or experiment.allows("D339"):
        return False
    inputs = {coordinate.path: coordinate.values for coordinate in experiment.cases.coordinates}
    outputs, columns = experiment.formulas.replay(inputs), []
    for path in looked_at.paths:
        value = experiment.parameters[path].value
        columns.append(outputs[value.output] if isinstance(value, Formula) else value)
    rows = np.stack(np.broadcast_arrays(*(np.atleast_1d(column) for column in columns)), axis=1).astype(float)
    return bool(looked_at.away(rows, structure.schedule.duration)[0].size)


@frozen
class GrappleNumbers:
    """The numbers that decide whether a grapple is distant: paths of scalars, then of vectors by component, those of
    gravities before those of the joints."""

    paths: tuple[str, ...]
    gravities: int

    def away(self, rows: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The rows with a distant grapple; for all rows the distance from the base, and the link's reach, m.

        rows  values at the paths: [case, path]
        """
        time, own, of_link = rows[:, 0], rows[:, 1:5], rows[:, 5:9]
        place, position, velocity, rate, com, middle, *others = np.moveaxis(rows[:, 9:].reshape(len(rows), -1, 3), 1, 0)
        g = sum(others[: self.gravities], np.zeros_like(place))
        away = _length(position + velocity * time[:, None] + 0.5 * g * (time * time)[:, None])
        reach = sum((_length(other) for other in others[self.gravities :]), _length(place))
        reach = reach + 2.0 * _length(middle) + _size(of_link)
        # its frame goes round its centre, which flies straight; and as far again as its body is large
        loose = _length(com) * (2.0 + _length(rate) * time) + _size(own)
        return np.flatnonzero((away > FAR * (reach + loose)) & (time <= duration)), away, reach


def grapple_numbers(structure: Structure, payload: Payload, parameters: Mapping[str, Any]) -> GrappleNumbers | None:
    """The numbers to check; None where no statement is possible: the base moves, a joint slides, the payload is pushed,
    or it is not grappled."""
    joints = way_inward(structure.joints, payload.link)
    if structure.base is not None or any(joint.kind == "prismatic" for joint in joints) or not payload.grappled:
        return None
    if _is_pushed(structure, payload, parameters):
        return None
    head = f"payloads.{payload.name}"
    link = f"links.{payload.link}" if f"links.{payload.link}.mass" in parameters else head
    sizes = ("mass", *(f"inertia.{x}{x}" for x in "xyz"))
    gravity = [f"environment.{load.name}.g" for load in structure.environment if load.model == "gravity"]
    numbers = [f"{head}.grapple", *(f"{owner}.{name}" for owner in (head, link) for name in sizes)]
    vectors = [
        *(f"{head}.{name}" for name in _OF_PAYLOAD),
        f"{link}.com",
        *gravity,
        *(f"{joint.name}.at" for joint in joints),
    ]
    return GrappleNumbers((*numbers, *(f"{vector}.{x}" for vector in vectors for x in "xyz")), len(gravity))


def _is_pushed(structure: Structure, payload: Payload, parameters: Mapping[str, Any]) -> bool:
    """Return True if forces other than uniform gravity may act on a payload before it is grappled."""
    known = models.find_own("environment")
    for load in structure.environment:
        model = models.find("environment", load.model, load.place)
        links = [parameter.name for parameter in model.parameters if parameter.names == "link"]
        named = [parameters.get(f"environment.{load.name}.{link}") for link in links]
        if load.model not in known or model.free_fall is not None:
            return True
        if any(joint_name is not None and joint_name.value == payload.name for joint_name in named):
            return True
    return False


def _observe(scope: Scope, payload: Payload, looked_at: GrappleNumbers, duration: float, place: Place) -> None:
    """Warn, once the cases are known, where a link grapples a payload that it cannot reach."""
    head = f"payloads.{payload.name}"
    settled = [scope.parameters.get(path) for path in looked_at.paths]
    values: list[Real] = [number.value for number in settled if number is not None]  # type: ignore[misc]  # they are numbers
    if len(values) < len(settled):
        return  # a missing one is already reported

    def warn(rows: np.ndarray) -> None:
        """Warn about the case in which the payload is furthest beyond the link's reach when it is grappled (D339).
        rows: [case, number], SI, the time of the grapple first."""
        if scope.complaints.error_count:
            return  # a number may be out of its range
        far, away, reach = looked_at.away(rows, duration)
        if far.size:
            row = far[np.argmax(away[far])]
            scope.complaints.remark(
                "D339",
                f"link `{payload.link}` grapples payload `{payload.name}` from afar: at {rows[row, 0]:.6g} s it flies "
                f"{away[row]:.4g} m from the base, and no part of the link is ever further than {reach[row]:.4g} m",
                place,
                help=[
                    "let it be at the link by then: change `position`, `velocity` or `grapple`",
                    f"`{head}.distance` is how far it is from its place",
                ],
            )

    scope.checks.observe(tuple(values), warn, place, needs=(head,))


def _size(rows: np.ndarray) -> np.ndarray:
    """Largest distance of a body's matter from its centre, for usual shapes, m; rows: mass, and moments of inertia (kg
    m^2)."""
    mass, largest = rows[:, 0], rows[:, 1:].max(axis=1)
    return np.asarray(3.0 * np.sqrt(largest / np.where(mass > 0.0, mass, math.inf)))


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(vectors, axis=1))


_OF_PAYLOAD = ("at", "position", "velocity", "rate", "com")
"""Vectors of a payload, in the order of the rows' columns."""
