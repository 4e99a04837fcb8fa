"""Outputs of a case and their units: recorded signals, joints' parts of them, metrics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from met import models
from met.plan import Recorded, Structure
from met.plan.channel import channel_paths, channels_beside, watched_unit
from met.plan.judged import FIGURES, MetricUse

OF_ALL = {"rel": "1", "time": "s"}
"""Tolerances that apply to everything, with units: a share of the value; how much earlier or later."""

GRAPPLE_FIGURES: Mapping[str, tuple[str, str]] = {
    "distance": ("m", "how far it was from its place as it was grappled"),
    "near": ("m", "the distance up to which it counts as near, by the sizes of payload, link and arm"),
    "speed": ("m/s", "the speed against the link that some part of it had then"),
    "rate": ("rad/s", "how fast it turned against the link then"),
    "energy": ("J", "kinetic energy that its grapple cost"),
}
"""Figures that are recorded of each grapple (`met.program.grapple`): units, and their meanings in words."""


def grappled_payloads(structure: Structure) -> tuple[str, ...]:
    """The payloads that are grappled in a run, by name."""
    return tuple(payload.name for payload in structure.payloads if payload.grappled)


def metric_units(structure: Structure, linear: Sequence[MetricUse] = ()) -> dict[str, str]:
    """The SI unit of each metric's result; `of` in its declaration stands for the channel's unit. linear: metrics of
    linear answers."""
    watched = channels_beside(structure, [use.of for use in structure.metrics])
    own = {use.name: _metric_unit(use, watched[use.of].unit) for use in structure.metrics}
    return own | {use.name: FIGURES[use.model].unit for use in linear}


def _metric_unit(use: MetricUse, watched: str) -> str:
    return watched_unit(str(models.find("metric", use.model, use.place).unit), watched)


def joint_parts(name: str, joints: tuple[str, ...]) -> tuple[str, ...]:
    """Names of each joint's part of a signal: `shoulder.qd`, `links.tip.jacobian.linear.shoulder`."""
    return channel_paths(name, joints, ()) if joints else ()


def tolerable(structure: Structure, linear: Sequence[MetricUse] = ()) -> dict[str, tuple[str, ...]]:
    """The names that a tolerance may have, with the unit, or units where a signal's joints have several: signals, a
    joint's part of one, metrics (`metrics.<name>` where a signal has the name too), `rel` and `time`."""
    out = {name: units for recorded in structure.record for name, units in _signal(recorded)}
    for name, unit in metric_units(structure, linear).items():
        out[f"metrics.{name}" if name in out else name] = (unit,)
    return out | {name: (unit,) for name, unit in OF_ALL.items()}


def _signal(recorded: Recorded) -> Iterator[tuple[str, tuple[str, ...]]]:
    yield recorded.name, tuple(dict.fromkeys(recorded.unit))
    inner = len(recorded.components) or 1
    for place, part in enumerate(joint_parts(recorded.name, recorded.joints)):
        yield part, (recorded.unit[place * inner if len(recorded.unit) > 1 else 0],)
