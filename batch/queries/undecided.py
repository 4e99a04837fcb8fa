"""Requirements on a time that a run does not show: it comes after the run's end, or there was nothing to wait for."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from batch.queries.requirements import GroupRequirement, group_requirements
from met import models
from met.diagnostic import Diagnostic, Label, Problem

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from met.plan import Experiment


def warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warnings about times that a run is too short to show, and about times that are 0 in all cases: of each kind
    about the first requirement, with the others by name.

    experiment  of the plan, for places
    """
    duration, undecided, none = float(group.attributes["duration_s"]), [], []
    for requirement in () if group.allows("D341") else group_requirements(group):
        times = group.values(requirement.metric)
        if not _is_time(str(group.variables[requirement.metric].attributes.get("model"))):
            continue
        unseen = int(np.isposinf(times).sum())
        if duration < requirement.limit < math.inf and unseen:
            undecided.append((requirement, unseen))
        elif len(times) and not times.any() and requirement.comparison.startswith("<"):
            none.append(requirement)
    return [*_unseen(group, experiment, duration, undecided), *_nothing(experiment, none)]


def _nothing(experiment: Experiment | None, requirements: list[GroupRequirement]) -> list[Diagnostic]:
    if not requirements:
        return []
    first, *others = requirements
    name = first.metric.rpartition(".")[2]
    message = (
        f"`require {first.text}` is met from the start: `{name}` is 0 s, since its signal left the band at no time"
    )
    helps = [
        "is it the signal that the command moves, and the band less than the motion? where it is to stay there, "
        "`peak` or `always(...)` says so"
    ]
    return _diagnostics(experiment, first, others, message, helps)


def _unseen(
    group: ArchiveGroup, experiment: Experiment | None, duration: float, undecided: list[tuple[GroupRequirement, int]]
) -> list[Diagnostic]:
    if not undecided:
        return []
    (first, unseen), *others = undecided
    many = f" in {unseen:,} of {group.count:,} cases" if group.count > 1 else ""
    name = first.metric.rpartition(".")[2]
    message = (
        f"`require {first.text}` looks beyond this run, which ends at {duration:.9g} s: `{name}` is not seen by "
        f"then{many}, and it may yet come"
    )
    helps = ["let the run last longer, or write an earlier limit"]
    return _diagnostics(experiment, first, [requirement for requirement, _ in others], message, helps)


def _diagnostics(
    experiment: Experiment | None,
    first: GroupRequirement,
    others: list[GroupRequirement],
    message: str,
    helps: list[str],
) -> list[Diagnostic]:
    if others:
        helps.append(f"the same of {', '.join(f'`require {other.text}`' for other in others)}")
    place = None if experiment is None else experiment.requirements[first.place].place
    return [Diagnostic("D341", message, None if place is None else Label(place), (), tuple(helps), "warning")]


def _is_time(model: str) -> bool:
    """True for a metric that is a time of its run; False where its package is missing."""
    try:
        return models.find("metric", model).times
    except Problem:
        return False
