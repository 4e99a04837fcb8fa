"""The varied parameters that explain each metric: the result of `met sensitivity`, as a table with a tornado."""

from __future__ import annotations

from batch.archive.read import ArchiveGroup
from batch.archive.searched import is_search
from batch.queries.pool import Pool, page_number
from batch.queries.requirements import group_requirements
from batch.queries.sensitivity import Sensitivity, notes_of, sensitivities, share_text, total_text
from batch.report.contents.parts import InfluencePart, InfluenceRow
from met.diagnostic import Problem
from met.statistics.sensitivity import FEWEST

MOST_METRICS, MOST_INPUTS, MOST_CASES = 6, 12, 50_000
"""Largest number of metrics, of parameters of each, and of cases that are used."""


def influences(pool: Pool) -> tuple[InfluencePart, ...]:
    """A part for each metric of a sweep of one structure with draws or enough cases, those with requirements first;
    none where one parameter varies, or a search chose the cases, which are not a sample."""
    if len(pool.groups) != 1 or is_search(pool.groups[0]):
        return ()
    [group] = pool.groups
    coordinates = group.role("coordinate")
    drawn = any(variable.attributes.get("design") for variable in coordinates)
    if len(coordinates) < 2 or group.count > MOST_CASES or not (drawn or group.count >= FEWEST):
        return ()
    names = _metrics(group)
    if group.count < FEWEST:
        return (InfluencePart("", f"Not enough cases to tell: {group.count:,}; {FEWEST} at least.", 0.0, (), ()),)
    try:
        return tuple(map(_part, sensitivities(group, names[:MOST_METRICS]))) if names else ()
    except Problem:  # nothing varies
        return ()


def _metrics(group: ArchiveGroup) -> list[str]:
    """The group's metrics, those with requirements first."""
    required = dict.fromkeys(group_requirement.metric for group_requirement in group_requirements(group))
    return list(dict.fromkeys([*required, *(variable.name for variable in group.role("metric"))]))


def _part(sensitivity: Sensitivity) -> InfluencePart:
    """The parameters that explain a metric, as texts of the page; without rows where there are too few cases."""
    count = f"{sensitivity.cases:,} cases" + (
        f"; {sensitivity.left:,} are left out, with no finite value" if sensitivity.left else ""
    )
    if sensitivity.cases < sensitivity.fewest:
        why_none = f"not enough cases, {count}; {sensitivity.fewest:,} at least"
        return InfluencePart(sensitivity.name, why_none, 0.0, (), ())
    if not sensitivity.shares:
        return InfluencePart(sensitivity.name, f"the same in all cases, {count}", 0.0, (), ())
    rows = []
    for place in sensitivity.order[:MOST_INPUTS]:
        share = sensitivity.shares[place]
        low, high = share.low / sensitivity.scale, share.high / sensitivity.scale
        rows.append(
            InfluenceRow(
                path=sensitivity.inputs[place],
                alone=share_text(share.first, share.first_by),
                together=total_text(share),
                low=low,
                high=high,
                ends=sensitivity.ends(share, f"{page_number(low)} …", page_number(high)),
                rank=f"{share.rank:+.2f}",
            )
        )
    notes = list(notes_of(sensitivity))
    if len(sensitivity.order) > len(rows):
        notes.append(f"{len(sensitivity.order) - len(rows):,} parameters more explain less")
    return InfluencePart(sensitivity.name, count, sensitivity.mean / sensitivity.scale, tuple(rows), tuple(notes))
