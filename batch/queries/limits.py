"""Limits of a signal: requirements, stops of its joint, limits of its servo, as lines of a picture."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from batch.queries.signals import Panel, number_text, pretty_unit
from met.frozen import frozen
from met.plan import Experiment

POINTWISE = {"max": (1.0,), "min": (1.0,), "final": (1.0,), "peak": (1.0, -1.0)}
"""Metrics with the unit of their signal, and the signs at which their limit is drawn; `peak` limits the size."""

LIMITED = {
    "voltage": "v_max",
    "current": "i_max",
    "current_cmd": "i_max",
    "motor_torque": "tau_max",
    "load_current": "i_max",
}
"""The parameter that limits a servo's or a bed's channel, either way, by the last word of the channel."""


@frozen
class LimitMark:
    """A limit: its name and value. time: True where the value is an instant"""

    text: str
    value: float
    time: bool = False


def limits_of(experiment: Experiment, panel: Panel, line: int) -> tuple[LimitMark, ...]:
    """The limits of one line of a panel, in the panel's unit; those that are finite, and the same in all cases."""
    joint = panel.joints[line]
    channel = panel.name if panel.name.startswith(f"{joint}.") or not joint else f"{joint}.{panel.name}"
    stops, servo = _stops(experiment, joint, panel), _servo(experiment, channel, panel)
    marks = (*_required(experiment, channel, panel), *stops, *servo)
    return tuple(dict.fromkeys(mark for mark in marks if math.isfinite(mark.value)))


def _required(experiment: Experiment, channel: str, panel: Panel) -> Iterator[LimitMark]:
    """The limits that requirements set to a channel, in the panel's unit."""
    watched = {metric.name: metric for metric in experiment.structure.metrics}
    for requirement in experiment.requirements:
        metric = watched.get(requirement.metric)
        if metric is None or metric.of != channel:
            continue
        if metric.model == "settling_time":
            yield LimitMark(requirement.text, requirement.limit, time=True)
        for sign in POINTWISE.get(metric.model, ()):
            yield LimitMark(requirement.text, sign * requirement.limit / panel.scale)


def _stops(experiment: Experiment, joint: str, panel: Panel) -> Iterator[LimitMark]:
    """The ends of a joint's stops as limits of its position, in the panel's unit."""
    if not joint or panel.variable.rpartition(".")[2] != "q":
        return
    for use in experiment.structure.environment:
        if use.model == "joint_stop" and _number(experiment, f"environment.{use.name}.joint") == joint:
            for end in ("lower", "upper"):
                value = _number(experiment, f"environment.{use.name}.{end}")
                if isinstance(value, float):
                    yield _mark(f"{use.name}.{end}", value / panel.scale, panel)


def _servo(experiment: Experiment, channel: str, panel: Panel) -> Iterator[LimitMark]:
    """The limits of a servo, or of a bed's motor, for a channel of it, in the panel's unit."""
    owner, _, member = channel.rpartition(".")
    if member in LIMITED and owner.rpartition(".")[2] in ("servo", "bed"):
        value = _number(experiment, f"{owner}.{LIMITED[member]}")
        if isinstance(value, float):
            limit_mark = _mark(LIMITED[member], value / panel.scale, panel)
            yield from (limit_mark, replace(limit_mark, value=-limit_mark.value))


def _number(experiment: Experiment, path: str) -> float | str | None:
    """The value of a parameter that no case varies; None for a varied one."""
    parameter = experiment.parameters.get(path)
    if parameter is None:
        return None
    if isinstance(parameter.value, str):
        return parameter.value
    return float(parameter.value) if isinstance(parameter.value, (int, float)) else None


def _mark(name: str, value: float, panel: Panel) -> LimitMark:
    unit = "" if panel.unit in ("", "1") else pretty_unit(panel.unit)
    return LimitMark(f"{name} {number_text(value)} {unit}".rstrip(), value)
