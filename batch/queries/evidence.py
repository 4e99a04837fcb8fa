"""Evidence for requirements over a share of cases: rows of the table that a review asks for.

Each is judged at each design point, by the cases that share all that was chosen: with a confidence by an exact bound on
the share of all cases that may be drawn there, else by the share of the cases that were run. A case that failed, or
whose metric has no value, misses it. Cases that were run until it was decided (`until_shown`) are judged by a test that
may be looked at after every case, and bounds that hold as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from batch.archive.read import ArchiveGroup, Stored
from batch.archive.searched import is_search
from batch.archive.summarised import CaseSummary
from batch.queries import requirements
from batch.queries.requirements import GroupRequirement
from batch.queries.search_answers import SearchAnswer
from batch.queries.signals import deck_unit, pretty_unit
from batch.queries.tallies import summed_up
from met.frozen import frozen
from met.statistics import confidence as fixed
from met.statistics import sequential
from met.statistics.design_points import design_points
from met.unit_parser import written

Verdict = Literal["met", "missed", "demonstrated", "not shown", "refuted"]
"""`met` and `missed` refer to the cases that were run; the others to all cases that may be drawn."""

ROUNDING = 1e-12
"""Allowance for rounding of a share: 7 % of 100 cases are 7.000000000000001 cases in floating point, and 7 of them are
enough."""

NOTHING_DRAWN = "no case was drawn at random: without a confidence"
SEARCHED = "in the cases of the answer alone, as an optimiser chose all others"
SOME_OF_THE_TABLE = "only some cases of the table were run: without a confidence"


@frozen(kw_only=True)
class EvidenceRow:
    """A requirement with its evidence from the cases of one design point, or from all cases where every case has to
    meet it.

    requirement  with its limit in SI;  unit, scale: in which its deck writes the metric, shown = SI / scale
    chosen       what was chosen at the design point: path -> text with its unit; empty where nothing was
    cases        of the design point;  missed: of these, with those that failed or have no value
    lower, upper bounds on the share of all cases that meet it, each with the confidence; None without one
    bound        of the percentile, on the side of the limit, with the confidence, SI; None where there is none
    worst        position in the group of the case that is nearest to the limit or furthest beyond it;  value: its, SI
    margin       from the worst value to the limit, SI, negative where it is beyond
    sigmas       from the mean of the values to the limit, in standard deviations of these; None where they are equal
    verdict      what follows;  more: cases still needed to demonstrate it if none of these misses it, else 0
    why          it was not judged as it asks for; "" where it was
    sequential   whether verdict and bounds are those of a test that was looked at after every case;  decided: the
                 number of cases after which it was decided so; None where it was not
    """

    requirement: GroupRequirement
    unit: str
    scale: float
    chosen: dict[str, str]
    cases: int
    missed: int
    worst: int
    value: float
    margin: float
    sigmas: float | None
    verdict: Verdict
    lower: float | None = None
    upper: float | None = None
    bound: float | None = None
    more: int = 0
    why: str = ""
    sequential: bool = False
    decided: int | None = None

    @property
    def ok(self) -> bool:
        """True if the requirement is met, or demonstrated where it asks for a confidence."""
        return self.verdict in ("met", "demonstrated")


def evidence(group: ArchiveGroup) -> list[EvidenceRow]:
    """The rows of evidence, what the cases show of a requirement over a share of them: one for each requirement and
    design point of an experiment. None, without reading values, where it has no such requirement, or is a search, whose
    cases an optimiser chose."""
    if is_search(group):
        return []
    return evidence_for(
        group,
        [
            group_requirement
            for group_requirement in requirements.group_requirements(group)
            if group_requirement.share is not None
        ],
    )


def evidence_for(group: ArchiveGroup, judged_requirements: Sequence[GroupRequirement]) -> list[EvidenceRow]:
    """The rows of evidence for these requirements, what the cases show of each: one for each design point, and a single
    one where every case has to meet it."""
    if not judged_requirements:
        return []
    everything = [DesignPoint({}, np.arange(group.count))]
    if (answer := SearchAnswer.of(group)) is not None:
        judged_requirements, why = answer.required, SEARCHED
        points = everything = [DesignPoint({}, np.array(answer.best.cases))]
    else:
        if is_search(group):  # a part of its cases: an optimiser chose them, so that every requirement judges each
            judged_requirements = [replace(required, share=None, confidence=None) for required in judged_requirements]
        if (summed := summed_up(group)) is not None:
            return list(_of_summary(group, summed, judged_requirements))
        points, why = _design_points(group)
    outcomes = requirements.outcomes(group)
    early = bool(group.attributes.get("until_shown"))
    out = []
    for judged_requirement in judged_requirements:
        values = group.values(judged_requirement.metric)
        scale, unit = deck_unit(group.variables[judged_requirement.metric])
        for point in points if judged_requirement.share is not None else everything:
            judged = _judged(
                judged_requirement, values[point.cases], outcomes[point.cases, judged_requirement.place], why, early
            )
            worst = int(point.cases[judged.pop("worst")])
            out.append(
                EvidenceRow(
                    requirement=judged_requirement, unit=unit, scale=scale, chosen=point.chosen, worst=worst, **judged
                )
            )
    return out


def _of_summary(
    group: ArchiveGroup, summary: CaseSummary, judged_requirements: Sequence[GroupRequirement]
) -> Iterator[EvidenceRow]:
    """The rows of requirements on all cases, from the summary that the archive keeps."""
    chosen = [group.variables[str(name)] for name in summary.values["chosen"]]
    why = _why_without_confidence(group)
    for requirement in judged_requirements:
        scale, unit = deck_unit(group.variables[requirement.metric])
        for row in summary.judged(requirement.place, whole=requirement.share is None):
            values = summary.values["chosen_value"][row["point"]] if row["point"] >= 0 else ()
            misses, spread = row["missed"] + row["unknown"], row["deviation"]
            verdict_fields: dict[str, Any] = {
                "cases": row["cases"],
                "missed": misses,
                "value": row["worst"],
                "margin": requirement.margin(row["worst"]),
                "sigmas": requirement.margin(row["mean"]) / spread if spread > 0.0 else None,
            }
            if _without_confidence(requirement, why):
                verdict_fields |= _counted(requirement, row["cases"], misses, why)
            else:
                verdict_fields |= _judged_by_counts(
                    requirement, row["cases"], misses, None if np.isnan(row["bound"]) else row["bound"]
                )
            worst = group.position_of(row["worst_case"])
            chosen_texts = {
                variable.path: _value_text(variable, value) for variable, value in zip(chosen, values, strict=False)
            }
            yield (
                EvidenceRow(
                    requirement=requirement, unit=unit, scale=scale, chosen=chosen_texts, worst=worst, **verdict_fields
                )
            )


@frozen
class DesignPoint:
    """A point of the design: its chosen values, path -> text with its unit, and the positions of its cases."""

    chosen: dict[str, str]
    cases: np.ndarray


def _design_points(group: ArchiveGroup) -> tuple[list[DesignPoint], str]:
    """The design points of a group, and the reason why they give no confidence; "" where they do.

    Where nothing was drawn there is one design point of all cases.
    """
    chosen = [variable for variable in group.role("coordinate") if not variable.attributes.get("design")]
    why = _why_without_confidence(group)
    if why == NOTHING_DRAWN or not chosen:
        return [DesignPoint({}, np.arange(group.count))], why
    with_values = [(variable, group.values(variable.name)) for variable in chosen]
    points = design_points([values for _, values in with_values], group.count)
    cases = np.split(np.argsort(points, kind="stable"), np.cumsum(np.bincount(points))[:-1])
    return [
        DesignPoint({v.path: _value_text(v, values[case_places[0]]) for v, values in with_values}, case_places)
        for case_places in cases
    ], why


def _why_without_confidence(group: ArchiveGroup) -> str:
    """The reason why the cases of a group give no confidence; "" where they do."""
    if (summed := summed_up(group)) is not None:
        drawn = summed.drawn
    else:
        designed = any(variable.attributes.get("design") for variable in group.role("coordinate"))
        drawn = designed or int(group.values("repeat").max(initial=0)) > 0
    if not drawn:
        return NOTHING_DRAWN
    some = group.run < int(group.attributes.get("cases_in_table", group.run))
    return SOME_OF_THE_TABLE if some and not group.attributes.get("until_shown") else ""


def _value_text(variable: Stored, value: float) -> str:
    """A value in the unit of the deck, in the fewest digits that give it again, with the unit typeset."""
    number, _, unit = written(value, str(variable.attributes.get("deck_unit", variable.unit))).partition(" ")
    return f"{number} {pretty_unit(unit)}".rstrip()


def _judged(
    requirement: GroupRequirement, values: np.ndarray, outcomes: np.ndarray, why: str, early: bool
) -> dict[str, Any]:
    """The verdict at a design point and its grounds, by the fields of `EvidenceRow`; `worst` is a place in its cases.

    values  of the metric, SI, in the order in which the cases were drawn;  outcomes: 1 met, 0 missed, -1 unknown
    why     no confidence can be had, "" where one can;  early: True where cases were run until it was decided
    """
    cases, missed, unknown = len(values), int((outcomes != 1).sum()), outcomes == -1
    worst = int(
        np.where(unknown, np.inf, requirements.beyond(values, requirement.comparison, requirement.limit)).argmax()
    )
    finite = values[np.isfinite(values)]
    deviation = float(finite.std(ddof=1)) if len(finite) > 1 else 0.0
    fields: dict[str, Any] = {
        "cases": cases,
        "missed": missed,
        "worst": worst,
        "value": float(values[worst]),
        "margin": requirement.margin(float(values[worst])),
        "sigmas": requirement.margin(float(finite.mean())) / deviation if deviation > 0.0 else None,
    }
    if _without_confidence(requirement, why):
        return {**fields, **_counted(requirement, cases, missed, why)}
    judged = _judged_early if early else _judged_once
    return {**fields, **judged(requirement, values, outcomes != 1, unknown)}


def _without_confidence(requirement: GroupRequirement, why: str) -> bool:
    """True where the finished cases decide the requirement, without a statement about others."""
    return requirement.share is None or requirement.confidence is None or bool(why)


def _counted(requirement: GroupRequirement, cases: int, missed: int, why: str) -> dict[str, Any]:
    """The verdict of the cases that were run. why: the reason why there is no confidence"""
    share = requirement.share if requirement.share is not None and requirement.confidence is None else 1.0
    verdict = "met" if cases - missed >= share * cases * (1.0 - ROUNDING) else "missed"
    return {"verdict": verdict, "why": why if requirement.confidence is not None else ""}


def _judged_once(
    requirement: GroupRequirement, values: np.ndarray, missed: np.ndarray, unknown: np.ndarray
) -> dict[str, Any]:
    """The verdict of cases whose number was fixed beforehand, and its bounds."""
    assert requirement.share is not None and requirement.confidence is not None
    rank = fixed.percentile_rank(len(values), requirement.share, requirement.confidence)
    return _judged_by_counts(
        requirement, len(values), int(missed.sum()), _order_statistic(requirement, values, unknown, rank)
    )


def _judged_by_counts(requirement: GroupRequirement, cases: int, misses: int, bound: float | None) -> dict[str, Any]:
    """The verdict from the number of cases, the number of misses, and the order statistic that bounds the
    percentile."""
    assert requirement.share is not None and requirement.confidence is not None
    verdict = fixed.verdict(cases, misses, requirement.share, requirement.confidence)
    return {
        "lower": fixed.lower_bound(cases, misses, requirement.confidence),
        "upper": fixed.upper_bound(cases, misses, requirement.confidence),
        "bound": bound,
        "verdict": verdict,
        "more": fixed.cases_needed(requirement.share, requirement.confidence, misses) - cases
        if verdict == "not shown"
        else 0,
    }


def _judged_early(
    requirement: GroupRequirement, values: np.ndarray, missed: np.ndarray, unknown: np.ndarray
) -> dict[str, Any]:
    """The verdict of cases that were looked at one after the other, and its bounds.

    A bound may be taken after any number of cases: the tighter one of those when it was decided and in the end.
    """
    assert requirement.share is not None and requirement.confidence is not None
    share, confidence = requirement.share, requirement.confidence
    number, verdict = sequential.decided(missed, share, confidence)
    looks = [(cases, int(missed[:cases].sum())) for cases in {number, len(values)}]
    statistics = [
        _order_statistic(
            requirement, values[:cases], unknown[:cases], sequential.percentile_rank(cases, share, confidence)
        )
        for cases, _ in looks
    ]
    tightest = min if requirement.below else max
    open_yet = verdict == "not shown"
    return {
        "lower": max(sequential.lower_bound(*look, confidence) for look in looks),
        "upper": min(sequential.upper_bound(*look, confidence) for look in looks),
        "bound": tightest((statistic for statistic in statistics if statistic is not None), default=None),
        "verdict": verdict,
        "more": sequential.cases_needed(share, confidence, int(missed.sum())) - len(values) if open_yet else 0,
        "sequential": True,
        "decided": None if open_yet else number,
    }


def _order_statistic(requirement: GroupRequirement, values: np.ndarray, unknown: np.ndarray, rank: int) -> float | None:
    """The value of a rank, counted from the limit's side, which bounds the percentile; None where there are too few
    cases, or it falls among those without a value."""
    if not rank:
        return None
    known = np.where(unknown, np.inf if requirement.below else -np.inf, values)
    statistic = float(np.sort(known)[rank - 1 if requirement.below else len(values) - rank])
    return statistic if np.isfinite(statistic) else None


def percent_below(share: float) -> str:
    """A share in percent, rounded down, with at least two digits of its difference from 100 %: `99.9962 %`."""
    return _percent(share, math.floor)


def percent_above(share: float) -> str:
    """A share in percent, rounded up."""
    return _percent(share, math.ceil)


def _percent(share: float, rounded: Callable[[float], int]) -> str:
    rest = 100.0 * (1.0 - share)
    digits = 2 if rest <= 0.0 else min(10, max(2, 1 - math.floor(math.log10(rest))))
    return f"{rounded(100.0 * share * 10**digits) / 10**digits:.{digits}f} %"
