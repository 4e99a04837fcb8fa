"""Limits of machines in an archive: how long cases were at them, and which requirements are judged there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from batch.queries.requirements import beyond, group_requirements
from met.diagnostic import Diagnostic, Label, Place
from met.frozen import frozen

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from batch.archive.stored import Stored
    from met.plan import Experiment


@frozen
class LimitSummary:
    """A limit over cases.

    limit   path of the parameter that sets it;  about: what the share is of, in words
    cases   how many came to it;  largest: of their shares of the run's time;  row: position of that case
    """

    limit: str
    about: str
    cases: int
    largest: float
    row: int


def limit_summaries(group: ArchiveGroup, here: slice = slice(None)) -> tuple[LimitSummary, ...]:
    """The limits of an experiment, or of some of its cases, in the archive's order; none of an older archive."""
    rows, found = group.values("case")[here], []
    for variable in group.role("limit"):
        shares = np.nan_to_num(group.values(variable.name)[here])
        worst, cases = int(shares.argmax()), int((shares > 0.0).sum())
        found.append(LimitSummary(_of(variable), variable.long_name, cases, float(shares[worst]), int(rows[worst])))
    return tuple(found)


def reached_texts(found: tuple[LimitSummary, ...], cases: int) -> list[str]:
    """`share of the time at elbow.servo.v_max: 12 %`, of each limit that a case came to."""
    out = []
    for each in found:
        if each.cases:
            of = f"{each.about}: {100.0 * each.largest:.3g} %"
            many = f"at most, in #{each.row}; not 0 in {each.cases:,} of {cases:,} cases"
            out.append(of if cases == 1 else f"{of} {many}")
    return out


def warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warning of requirements that are judged by what a limit cut, unless the run allows it.

    experiment  of the plan, for places
    """
    if group.allows("D344"):
        return []
    at_extremes = {_of(variable): variable for variable in group.role("extreme")}
    judged = []
    for each in group_requirements(group):
        variable = at_extremes.get(group.variables[each.metric].path)
        if variable is not None and (at := group.values(variable.name)).any():
            judged.append((each, variable, at))
    if not judged:
        return []
    required, variable, at = max(judged, key=lambda found: int((found[2] > 0).sum()))
    values = group.values(required.metric)
    far = np.where(at > 0, beyond(values, required.comparison, required.limit), -np.inf)
    worst, cases = int(far.argmax()), int((at > 0).sum())
    path = str(variable.attributes["flag_meanings"]).split()[at[worst]]
    of = f", in {cases:,} of {group.count:,} cases, worst in #{group.values('case')[worst]}" if group.count > 1 else ""
    told = group.variables[required.metric].attributes
    message = (
        f"the {told.get('model')} of {told.get('of')} that `require {required.text}` judges fell while `{path}` was "
        f"reached{of}"
    )
    helps = [f"raise `{path}`, or ask for a motion that does not come to it"]
    if len(judged) > 1:
        others = ", ".join(f"`{each.text}`" for each, _, _ in judged if each is not required)
        helps.append(f"the same of {others}")
    place = None if experiment is None else experiment.requirements[required.place].place
    set_at = None if experiment is None or path not in experiment.parameters else _place(experiment, path)
    also = () if set_at is None else (Label(set_at, "the limit"),)
    return [Diagnostic("D344", message, None if place is None else Label(place), also, tuple(helps), "warning")]


def _place(experiment: Experiment, path: str) -> Place | None:
    return experiment.parameters[path].origin.place


def _of(variable: Stored) -> str:
    return str(variable.attributes.get("of", variable.name))
