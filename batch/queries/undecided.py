"""Requirements on a time whose limit is after a run's end, in cases that have not reached it by then: neither met nor
missed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from batch.queries.requirements import group_requirements
from met import models
from met.diagnostic import Diagnostic, Label, Problem

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from met.plan import Experiment


def warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warning about times that a run is too short to show, if there is one: about the first requirement, with the
    others by name.

    experiment  of the plan, for places
    """
    duration, found = float(group.attributes["duration_s"]), []
    for each in group_requirements(group):
        unseen = int(np.isposinf(group.values(each.metric)).sum())
        if (
            duration < each.limit < math.inf
            and unseen
            and _is_time(str(group.variables[each.metric].attributes.get("model")))
        ):
            found.append((each, unseen))
    if not found or group.allows("D341"):
        return []
    (first, unseen), *others = found
    many = f" in {unseen:,} of {group.count:,} cases" if group.count > 1 else ""
    name = first.metric.rpartition(".")[2]
    message = (
        f"`require {first.text}` looks beyond this run, which ends at {duration:.9g} s: `{name}` is not seen by "
        f"then{many}, and it may yet come"
    )
    helps = ["let the run last longer, or write an earlier limit"]
    if others:
        helps.append(f"the same of {', '.join(f'`require {each.text}`' for each, _ in others)}")
    place = None if experiment is None else experiment.requirements[first.place].place
    return [Diagnostic("D341", message, None if place is None else Label(place), (), tuple(helps), "warning")]


def _is_time(model: str) -> bool:
    """True for a metric that is a time of its run; False where its package is missing."""
    try:
        return models.find("metric", model).times
    except Problem:
        return False
