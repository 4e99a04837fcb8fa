"""Uses of a servo's inputs, found by recording its functions once with placeholders for numbers: no engine is built.

A compiler asks this before any program is built. A model that cannot be recorded gives no answer here: its fault is
reported where its program is built.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from types import SimpleNamespace
from typing import Any, TypeVar

from met import models
from met.parameter import Parameter
from met.plan import ServoUse
from met.plan.uses import quantities, servo_parts
from met.servos.servo import JointMotion, Seen, Setpoint
from met.trace import Graph, Real, Scalar

T = TypeVar("T")


def reads(use: ServoUse, values: Mapping[str, Any]) -> frozenset[str] | None:
    """Quantities that the law's outputs and integrals depend on, among those it could see (`met.plan.uses.quantities`).

    values  of the servo's parameters, for its words and lists;  None: the law could not be recorded
    """
    servo, parts, graph = models.find("servo", use.model, use.place), servo_parts(use), Graph()
    if servo.control is None:
        return frozenset()
    of_law = parts.integrals if parts.continuous else (*parts.outputs, *parts.integrals)
    seen = Seen(
        graph.input("q"),
        graph.input("qd"),
        Setpoint(use.command_kind, graph.input(":asked"), graph.input(":slope")),
        0.0 if parts.continuous else 1.0,
        graph.input(":time"),
        SimpleNamespace(**{state.name: graph.input(state.name) for state in parts.natural}),
    )
    tried = _tried(servo.control, _parameters(graph, parts.parameters, values), _named(graph, of_law), seen)
    if tried is None:
        return None
    roots = [x.ref for x in (*tried.outputs.values(), *tried.slopes.values()) if isinstance(x, Scalar)]
    inputs = {graph.nodes[position][1] for position in graph.live(roots) if graph.nodes[position][0] == "input"}
    return frozenset(inputs & set(quantities(use)))


def of_law(use: ServoUse, values: Mapping[str, Any]) -> Hashable:
    """The part of a servo's use that determines `reads`: uses with equal parts read the same."""
    decides = tuple(
        (parameter.name, values[parameter.name])
        for parameter in servo_parts(use).parameters
        if not _is_input(parameter)
    )
    return use.model, use.words, use.continuous, use.command_kind, decides


def accelerates(use: ServoUse, values: Mapping[str, Any]) -> bool | None:
    """True where the servo prescribes its joint's acceleration, at least at times. None: it could not be recorded."""
    servo, parts, graph = models.find("servo", use.model, use.place), servo_parts(use), Graph()
    q, qd, time, begin = (graph.input(name) for name in ("q", "qd", ":time", ":begin"))
    joint = JointMotion(q, qd, time, begin, use.command_kind)
    held, states = _named(graph, (*parts.outputs, *parts.integrals)), _named(graph, parts.natural)
    drive = _tried(servo.drive, _parameters(graph, parts.parameters, values), held, states, joint)
    return None if drive is None else drive.given is not None


def _parameters(graph: Graph, declared: Iterable[Any], values: Mapping[str, Any]) -> SimpleNamespace:
    """Placeholders for numbers; words, lists and numbers that shape the program keep their values."""
    placeholders: dict[str, Any] = {}
    for parameter in declared:
        path = f":{parameter.name}"
        if not _is_input(parameter):
            placeholders[parameter.name] = values[parameter.name]
        elif parameter.shape == "vector":
            placeholders[parameter.name] = tuple(graph.input(f"{path}.{axis}") for axis in "xyz")
        else:
            placeholders[parameter.name] = graph.input(path)
    return SimpleNamespace(**placeholders)


def _is_input(parameter: Parameter) -> bool:
    """True for a parameter whose number has a placeholder."""
    return parameter.shape == "vector" or (parameter.shape == "number" and not parameter.decides)


def _named(graph: Graph, parts: Iterable[Any]) -> SimpleNamespace:
    numbers: dict[str, Real] = {part.name: graph.input(f":held {part.name}") for part in parts}
    return SimpleNamespace(**numbers)


def _tried(function: Callable[..., T], *arguments: Any) -> T | None:
    """The result of a model's function; None where it raises anything, since it is its author's code."""
    try:
        return function(*arguments)
    except KeyboardInterrupt:
        raise
    except BaseException:
        return None
