"""The group `verification` of an experiment: some cases' metrics, with the dynamics at half and a quarter of the step.

    verified_case     positions of the cases in the case table, rising; a dimension
    verified_metric   names of the metrics' variables; a dimension
    half, quarter     the metrics at half and a quarter of the step, SI; not-a-number where such a case failed
    instant           s, of a metric that is an instant seen at whole steps: a quarter of the step; 0 for others
    attributes        `order` of the integrator; `step_s`, the campaign's own step

The values at the step itself are the campaign's own. Numbers are kept and no conclusions: errors follow from them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from batch.archive.hdf5 import h5py
from batch.archive.sound import MOST, are_cases
from batch.archive.stored import StoredGroup, Unlike
from met.frozen import frozen

NAME = "verification"

MOST_ORDER = 100
"""No integrator has such an order."""

DIMENSIONS = ("verified_case", "verified_metric")

VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "verified_case": (("verified_case",), "<i8", "cases that were run with shorter steps, by position in the table"),
    "verified_metric": (("verified_metric",), "|O", "their metrics"),
    "half": (DIMENSIONS, "<f8", "metrics with the dynamics at half of the step, SI"),
    "quarter": (DIMENSIONS, "<f8", "metrics with the dynamics at a quarter of the step, SI"),
    "instant": (("verified_metric",), "<f8", "s between instants at which an instant is seen; 0 for other metrics"),
}
"""Dimensions, type and meaning of each variable."""


@frozen
class Verified:
    """The metrics that were computed with shorter steps.

    cases          [case] positions in the case table, rising
    metrics        names of the metrics' variables in the archive
    half, quarter  [case, metric] SI, at half and a quarter of the step; not-a-number where a case failed
    instant        [metric] s: a quarter of the step for an instant that is seen at whole steps, else 0
    order          of the integrator;  step: the campaign's own, s
    """

    cases: np.ndarray
    metrics: tuple[str, ...]
    half: np.ndarray
    quarter: np.ndarray
    instant: np.ndarray
    order: int
    step: float


def write(parent: Any, found: Verified) -> None:
    """Write the group into an experiment's, of a file that is open."""
    node = parent.create_group(NAME, track_order=True)
    node.attrs["order"] = found.order
    node.attrs["step_s"] = found.step
    values = {
        "verified_case": found.cases,
        "verified_metric": np.array(found.metrics, dtype=object),
        "half": found.half,
        "quarter": found.quarter,
        "instant": found.instant,
    }
    for name, (_, kind, words) in VARIABLES.items():
        dtype = h5py().string_dtype("utf-8") if kind == "|O" else kind
        dataset = node.create_dataset(name, data=values[name], dtype=dtype, track_order=True)
        dataset.attrs["long_name"] = words
    for name in DIMENSIONS:
        node[name].make_scale(name)
    for name, (dims, _, _) in VARIABLES.items():
        if name not in DIMENSIONS:
            for axis, dim in enumerate(dims):
                node[name].dims[axis].attach_scale(node[dim])


def read(node: Any, group: StoredGroup) -> Verified | None:
    """The verified metrics of an experiment's group, checked; None where nothing was verified. Raises Unlike."""
    inside = node.get(NAME)
    if not isinstance(inside, h5py().Group):  # a metric of an older archive may be called so
        return None
    values = {name: _values(inside, name) for name in VARIABLES}
    sizes = {dim: len(values[dim]) for dim in DIMENSIONS}
    for name, (dims, _, _) in VARIABLES.items():
        if values[name].shape != tuple(sizes[dim] for dim in dims):
            raise Unlike(f"variable `{NAME}/{name}` is not of the size of its dimensions")
    cases, metrics = values["verified_case"], tuple(map(str, values["verified_metric"].tolist()))
    if not len(cases) or not (np.diff(cases) > 0).all() or not are_cases(group, cases).all():
        raise Unlike("its verified cases are none of its cases")
    there = {variable.name for variable in group.role("metric")}
    if not metrics or len(set(metrics)) != len(metrics) or not there.issuperset(metrics):
        raise Unlike("its verified metrics are none of its metrics")
    instant = values["instant"]
    if not ((instant >= 0.0) & (instant < MOST)).all():
        raise Unlike(f"variable `{NAME}/instant` has a value that it cannot have")
    order, step = inside.attrs.get("order"), inside.attrs.get("step_s")
    if not isinstance(order, np.integer) or not 0 < order < MOST_ORDER:
        raise Unlike(f"attribute `order` of `{NAME}` is missing or of another type")
    if not isinstance(step, np.floating) or not 1 / MOST < step < MOST:
        raise Unlike(f"attribute `step_s` of `{NAME}` is missing or of another type")
    return Verified(cases, metrics, values["half"], values["quarter"], instant, int(order), float(step))


def _values(inside: Any, name: str) -> np.ndarray:
    dataset = inside.get(name)
    if not isinstance(dataset, h5py().Dataset) or str(dataset.dtype.str) != VARIABLES[name][1]:
        raise Unlike(f"variable `{NAME}/{name}` is missing or of another type")
    if len(dataset.shape) != len(VARIABLES[name][0]):
        raise Unlike(f"variable `{NAME}/{name}` is not of the size of its dimensions")
    if VARIABLES[name][1] == "|O":
        if h5py().check_string_dtype(dataset.dtype) is None:
            raise Unlike(f"variable `{NAME}/{name}` is missing or of another type")
        return np.asarray(dataset.asstr()[...], dtype=object)
    return np.asarray(dataset[...])
