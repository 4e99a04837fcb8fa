"""The group `verification` of an experiment: some cases' metrics, with the dynamics at half and a quarter of the step.

    verified_case     positions of the cases in the case table, rising; a dimension
    verified_metric   names of the metrics' variables; a dimension
    half, quarter     the metrics at half and a quarter of the step, SI; not-a-number where such a case failed
    instant           s, of a metric that is an instant seen at whole steps: a quarter of the step; 0 for others
    missed            how far the metric at a quarter of the step may be off by what lies between samples, SI, as
                      met/metrics/metric.py has it; 0 for what samples do not miss
    attributes        `order` of the integrator; `step_s`, the campaign's own step

The values at the step itself are the campaign's own. Only these numbers are stored; errors are computed from them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from batch.archive import stored
from batch.archive.hdf5 import h5py
from batch.archive.sound import MOST, are_cases
from batch.archive.stored import COUNT, NUMBER, WORDS, StoredGroup, Unlike
from met.frozen import frozen
from met.host.files import parse_json
from met.plan.judged import StepErrorLimit

ATTRIBUTE = "step_errors"

FIELDS = {"text": str, "metric": str, "comparison": str, "limit": float, "share": bool}
"""The fields of each requirement, with their types."""


def written(limits: Iterable[StepErrorLimit], names: Mapping[str, str]) -> str:
    """The value of the attribute. names: of the metrics' variables, by the metrics' own"""
    plain = [{name: getattr(limit, name) for name in FIELDS} | {"metric": names[limit.metric]} for limit in limits]
    return json.dumps(plain, sort_keys=True, separators=(",", ":"))


def read_limits(group: StoredGroup) -> Iterator[StepErrorLimit]:
    """The requirements of a group; their metrics are names of variables. Raises Unlike."""
    text = group.attributes.get(ATTRIBUTE, "[]")
    try:
        plain = parse_json(text) if isinstance(text, str) else None
    except ValueError:
        plain = None
    if not isinstance(plain, list):
        raise Unlike(f"attribute `{ATTRIBUTE}` is no list of requirements")
    metrics = {variable.name for variable in group.role("metric")}
    for entry in plain:
        good = isinstance(entry, dict) and all(type(entry.get(name)) is kind for name, kind in FIELDS.items())
        if (
            not good
            or entry["metric"] not in metrics
            or entry["comparison"] not in ("<", "<=")
            or not entry["limit"] > 0
        ):
            raise Unlike(f"attribute `{ATTRIBUTE}` is no list of requirements")
        yield StepErrorLimit(**{name: entry[name] for name in FIELDS})


NAME = "verification"

MOST_ORDER = 100
"""Upper bound of an integrator's order."""

DIMENSIONS = ("verified_case", "verified_metric")

VARIABLES: stored.Declared = {
    "verified_case": (("verified_case",), COUNT, "cases that were run with shorter steps, by position in the table"),
    "verified_metric": (("verified_metric",), WORDS, "their metrics"),
    "half": (DIMENSIONS, NUMBER, "metrics with the dynamics at half of the step, SI"),
    "quarter": (DIMENSIONS, NUMBER, "metrics with the dynamics at a quarter of the step, SI"),
    "instant": (("verified_metric",), NUMBER, "s between instants at which an instant is seen; 0 for other metrics"),
    "missed": (DIMENSIONS, NUMBER, "distances of metrics at a quarter of the step to what may lie between samples, SI"),
}
"""Dimensions, type and meaning of each variable."""


@frozen
class Verified:
    """The metrics that were computed with shorter steps.

    cases          [case] positions in the case table, rising
    metrics        names of the metrics' variables in the archive
    half, quarter  [case, metric] SI, at half and a quarter of the step; not-a-number where a case failed
    instant        [metric] s: a quarter of the step for an instant that is seen at whole steps, else 0
    missed         [case, metric] SI, at least 0: how far `quarter` may be off by what lies between samples
    order          of the integrator;  step: the campaign's own, s
    """

    cases: np.ndarray
    metrics: tuple[str, ...]
    half: np.ndarray
    quarter: np.ndarray
    instant: np.ndarray
    missed: np.ndarray
    order: int
    step: float


def write(parent: Any, verified_metrics: Verified) -> None:
    """Write the group into an experiment's group of an open file."""
    node = parent.create_group(NAME, track_order=True)
    node.attrs["order"] = verified_metrics.order
    node.attrs["step_s"] = verified_metrics.step
    values = {
        "verified_case": verified_metrics.cases,
        "verified_metric": np.array(verified_metrics.metrics, dtype=object),
        "half": verified_metrics.half,
        "quarter": verified_metrics.quarter,
        "instant": verified_metrics.instant,
        "missed": verified_metrics.missed,
    }
    stored.write(node, VARIABLES, values)


def read(node: Any, group: StoredGroup) -> Verified | None:
    """The verified metrics of an experiment's group, checked; None where nothing was verified. Raises Unlike."""
    inside = node.get(NAME)
    if not isinstance(inside, h5py().Group):  # a metric of an older archive may have this name
        return None
    declared = {name: VARIABLES[name] for name in VARIABLES if name != "missed" or name in inside}  # later than others
    values = stored.read(inside, declared, NAME)
    cases, metrics = values["verified_case"], tuple(map(str, values["verified_metric"].tolist()))
    if not len(cases) or not (np.diff(cases) > 0).all() or not are_cases(group, cases).all():
        raise Unlike("its verified cases are none of its cases")
    metric_names = {variable.name for variable in group.role("metric")}
    if not metrics or len(set(metrics)) != len(metrics) or not metric_names.issuperset(metrics):
        raise Unlike("its verified metrics are none of its metrics")
    instant = values["instant"]
    if not ((instant >= 0.0) & (instant < MOST)).all():
        raise Unlike(f"variable `{NAME}/instant` has a value that it cannot have")
    missed = values.get("missed", np.zeros(values["quarter"].shape))
    if (missed < 0.0).any():
        raise Unlike(f"variable `{NAME}/missed` has a value that it cannot have")
    order, step = inside.attrs.get("order"), inside.attrs.get("step_s")
    if not isinstance(order, np.integer) or not 0 < order < MOST_ORDER:
        raise Unlike(f"attribute `order` of `{NAME}` is missing or of another type")
    if not isinstance(step, np.floating) or not 1 / MOST < step < MOST:
        raise Unlike(f"attribute `step_s` of `{NAME}` is missing or of another type")
    return Verified(cases, metrics, values["half"], values["quarter"], instant, missed, int(order), float(step))
