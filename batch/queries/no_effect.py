"""Axes of a sweep under which no metric of any case changes by more than rounding."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ic.printing.columns import count as counted
from met.diagnostic import Diagnostic, Label
from met.run import DONE

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from met.plan import Experiment


ROUNDING = 1e-9
"""Largest change of a metric that counts as none, as a share of the metric."""


def warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warning about axes that change no metric, if there are any: about the first, with the others by name.

    experiment  of the plan, for places
    """
    done = group.values("status") == DONE
    metrics = [group.values(variable.name)[done] for variable in group.role("metric")]
    axes = {variable.path: group.values(variable.name)[done] for variable in group.role("coordinate")}
    if group.allows("D329") or not all(np.isfinite(metric).all() for metric in metrics):
        return []  # of a metric that is not finite nobody knows what changes it
    idle = _idle(axes, metrics)
    if not idle:
        return []
    first, *others = idle
    values = counted(len(np.unique(axes[first])), "value")
    same = (
        f"the {len(metrics)} metrics are the same to 9 digits"
        if len(metrics) > 1
        else "its metric is the same to 9 digits"
    )
    message = f"`{first}` changes no metric of any case: at its {values}, all else the same, {same}"
    helps = ["is it what was meant to vary? a metric of what it changes would show it"]
    if others:
        helps.append(f"the same of {', '.join(f'`{path}`' for path in others)}")
    places = (
        {} if experiment is None else {coordinate.path: coordinate.place for coordinate in experiment.cases.coordinates}
    )
    place = places.get(first)
    return [Diagnostic("D329", message, None if place is None else Label(place), (), tuple(helps), "warning")]


def _idle(axes: dict[str, np.ndarray], metrics: list[np.ndarray]) -> list[str]:
    """The axes that change no metric between cases that differ in them alone. Parameters that vary together are one
    axis. Where no cases differ in one axis alone, as in a sample, all axes if no metric changes at all."""
    codes = {path: np.unique(values, return_inverse=True)[1] for path, values in axes.items()}
    together: dict[bytes, list[str]] = {}
    for path, code in codes.items():
        if code.any():
            together.setdefault(code.tobytes(), []).append(path)
    if not metrics or not together:
        return []
    idle, compared = list[str](), False
    for paths in together.values():
        others = [codes[names[0]] for names in together.values() if names is not paths]
        rest = _numbered(others, len(codes[paths[0]]))
        alone = not _same(rest, [codes[paths[0]]])
        compared |= alone
        if alone and _same(rest, metrics):
            idle += paths
    if not compared and _same(_numbered([], len(metrics[0])), metrics):
        return [path for paths in together.values() for path in paths]
    return idle


def _numbered(codes: Iterable[np.ndarray], count: int) -> np.ndarray:
    """A number for each case, equal for cases that have all these codes equal."""
    numbers = np.zeros(count, np.int64)
    for code in codes:
        numbers = np.unique(numbers * (code.max() + 1) + code, return_inverse=True)[1]
    return numbers


def _same(plants: np.ndarray, values: Iterable[np.ndarray]) -> bool:
    """True where cases with the same number in `plants` have the same values, but for rounding."""
    _, first, number = np.unique(plants, return_index=True, return_inverse=True)
    return all(np.isclose(value[first[number]], value, rtol=ROUNDING, atol=0.0).all() for value in values)
