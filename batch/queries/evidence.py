"""Evidence for requirements over a share of cases: rows of the table that a review asks for.

Each is judged at each design point, by the cases that share all that was chosen: with a confidence by an exact bound on
the share of all cases that may be drawn there, else by the share of the cases that were run. A case that failed, or
whose metric has no value, misses it. Cases that were run until it was decided (`until_shown`) are judged by a test that
may be looked at after every case, and bounds that hold as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
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
from batch.queries.streamed import summed_up
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
    """The rows of an experiment's requirements over a share of cases, at each of its design points; none, without
    reading values, where it has no such requirement, or is a search, whose cases an optimiser chose."""
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


def evidence_for(group: ArchiveGroup, found: Sequence[GroupRequirement]) -> list[EvidenceRow]:
    """The rows of these requirements: one for each design point, and a single one where every case has to meet it."""
    if not found:
        return []
    if (answer := SearchAnswer.of(group)) is not None:
        return _of_answer(answer)
    if is_search(group):  # a part of its cases: an optimiser chose them, so that each is judged by every requirement
        found = [replace(each, share=None, confidence=None) for each in found]
    if (summed := summed_up(group)) is not None:
        return _of_summary(group, summed, found)
    outcomes = requirements.outcomes(group)
    points, why = _design_points(group)
    early = bool(group.attributes.get("until_shown"))
    out = []
    for each in found:
        values = group.values(each.metric)
        scale, unit = deck_unit(group.variables[each.metric])
        for point in points if each.share is not None else [DesignPoint({}, np.arange(group.count))]:
            judged = _judged(each, values[point.cases], outcomes[point.cases, each.place], why, early)
            worst = int(point.cases[judged.pop("worst")])
            out.append(
                EvidenceRow(requirement=each, unit=unit, scale=scale, chosen=point.chosen, worst=worst, **judged)
            )
    return out


def _of_answer(answer: SearchAnswer) -> list[EvidenceRow]:
    """The rows of the requirements in the cases of a search's answer, each asked of every one of these."""
    group, here = answer.group, np.array(answer.found.cases)
    met, out = requirements.outcomes(group), []
    for each in answer.required:
        judged = _judged(each, group.values(each.metric)[here], met[here, each.place], SEARCHED, early=False)
        scale, unit = deck_unit(group.variables[each.metric])
        worst = int(here[judged.pop("worst")])
        out.append(EvidenceRow(requirement=each, unit=unit, scale=scale, chosen={}, worst=worst, **judged))
    return out


def _of_summary(group: ArchiveGroup, summary: CaseSummary, found: Sequence[GroupRequirement]) -> list[EvidenceRow]:
    """The rows of requirements on all cases, from the summary that the archive keeps."""
    chosen = [group.variables[str(name)] for name in summary.values["chosen"]]
    why = _why_without_confidence(group, group.role("coordinate"))
    out = []
    for each in found:
        scale, unit = deck_unit(group.variables[each.metric])
        sign = 1.0 if each.comparison.startswith("<") else -1.0
        for row in summary.judged(each.place, whole=each.share is None):
            values = summary.values["chosen_value"][row["point"]] if row["point"] >= 0 else ()
            misses, spread = row["missed"] + row["unknown"], row["deviation"]
            told: dict[str, Any] = {
                "cases": row["cases"],
                "missed": misses,
                "value": row["worst"],
                "margin": sign * (each.limit - row["worst"]),
                "sigmas": sign * (each.limit - row["mean"]) / spread if spread > 0.0 else None,
            }
            if _without_confidence(each, why):
                told |= _counted(each, row["cases"], misses, why)
            else:
                told |= _judged_by_counts(each, row["cases"], misses, None if np.isnan(row["bound"]) else row["bound"])
            worst = group.position_of(row["worst_case"])
            at = {variable.path: _shown(variable, value) for variable, value in zip(chosen, values, strict=False)}
            out.append(EvidenceRow(requirement=each, unit=unit, scale=scale, chosen=at, worst=worst, **told))
    return out


@frozen
class DesignPoint:
    """A point of the design: its chosen values, path -> text with its unit, and the positions of its cases."""

    chosen: dict[str, str]
    cases: np.ndarray


def _design_points(group: ArchiveGroup) -> tuple[list[DesignPoint], str]:
    """The design points of a group, and the reason why they give no confidence; "" where they do.

    Where nothing was drawn there is one design point of all cases.
    """
    everything = [DesignPoint({}, np.arange(group.count))]
    coordinates = group.role("coordinate")
    drawn = [variable for variable in coordinates if variable.attributes.get("design")]
    why = _why_without_confidence(group, coordinates)
    if why == NOTHING_DRAWN:
        return everything, why
    chosen = [(variable, group.values(variable.name)) for variable in coordinates if variable not in drawn]
    if not chosen:
        return everything, why
    points = design_points([values for _, values in chosen], group.count)
    cases = np.split(np.argsort(points, kind="stable"), np.cumsum(np.bincount(points))[:-1])
    return [DesignPoint({v.path: _shown(v, values[here[0]]) for v, values in chosen}, here) for here in cases], why


def _why_without_confidence(group: ArchiveGroup, coordinates: Sequence[Stored]) -> str:
    """The reason why the cases of a group give no confidence; "" where they do."""
    if (summed := summed_up(group)) is not None:
        drawn = summed.drawn
    else:
        drawn = any(variable.attributes.get("design") for variable in coordinates)
        drawn = drawn or int(group.values("repeat").max(initial=0)) > 0
    if not drawn:
        return NOTHING_DRAWN
    some = group.run < int(group.attributes.get("cases_in_table", group.run))
    return SOME_OF_THE_TABLE if some and not group.attributes.get("until_shown") else ""


def _shown(variable: Stored, value: float) -> str:
    """A value in the unit of the deck, in the fewest digits that give it again, with the unit typeset."""
    number, _, unit = written(value, str(variable.attributes.get("deck_unit", variable.unit))).partition(" ")
    return f"{number} {pretty_unit(unit)}".rstrip()


def _judged(each: GroupRequirement, values: np.ndarray, outcomes: np.ndarray, why: str, early: bool) -> dict[str, Any]:
    """The verdict at a design point and its grounds, by the fields of `EvidenceRow`; `worst` is a place in its cases.

    values  of the metric, SI, in the order in which the cases were drawn;  outcomes: 1 met, 0 missed, -1 unknown
    why     no confidence can be had, "" where one can;  early: True where cases were run until it was decided
    """
    cases, missed, unknown = len(values), int((outcomes != 1).sum()), outcomes == -1
    worst = int(np.where(unknown, np.inf, requirements.beyond(values, each.comparison, each.limit)).argmax())
    sign = 1.0 if each.comparison.startswith("<") else -1.0
    finite = values[np.isfinite(values)]
    deviation = float(finite.std(ddof=1)) if len(finite) > 1 else 0.0
    found: dict[str, Any] = {
        "cases": cases,
        "missed": missed,
        "worst": worst,
        "value": float(values[worst]),
        "margin": sign * (each.limit - float(values[worst])),
        "sigmas": sign * (each.limit - float(finite.mean())) / deviation if deviation > 0.0 else None,
    }
    if _without_confidence(each, why):
        return {**found, **_counted(each, cases, missed, why)}
    judged = _judged_early if early else _judged_once
    return {**found, **judged(each, values, outcomes != 1, unknown)}


def _without_confidence(each: GroupRequirement, why: str) -> bool:
    """True where the finished cases decide the requirement, without a statement about others."""
    return each.share is None or each.confidence is None or bool(why)


def _counted(each: GroupRequirement, cases: int, missed: int, why: str) -> dict[str, Any]:
    """The verdict of the cases that were run. why: the reason why there is no confidence"""
    share = each.share if each.share is not None and each.confidence is None else 1.0
    verdict = "met" if cases - missed >= share * cases * (1.0 - ROUNDING) else "missed"
    return {"verdict": verdict, "why": why if each.confidence is not None else ""}


def _judged_once(each: GroupRequirement, values: np.ndarray, missed: np.ndarray, unknown: np.ndarray) -> dict[str, Any]:
    """The verdict of cases whose number was fixed beforehand, and its bounds."""
    assert each.share is not None and each.confidence is not None
    rank = fixed.percentile_rank(len(values), each.share, each.confidence)
    return _judged_by_counts(each, len(values), int(missed.sum()), _order_statistic(each, values, unknown, rank))


def _judged_by_counts(each: GroupRequirement, cases: int, misses: int, bound: float | None) -> dict[str, Any]:
    """The verdict from the number of cases, the number of misses, and the order statistic that bounds the
    percentile."""
    assert each.share is not None and each.confidence is not None
    verdict = fixed.verdict(cases, misses, each.share, each.confidence)
    return {
        "lower": fixed.lower_bound(cases, misses, each.confidence),
        "upper": fixed.upper_bound(cases, misses, each.confidence),
        "bound": bound,
        "verdict": verdict,
        "more": fixed.cases_needed(each.share, each.confidence, misses) - cases if verdict == "not shown" else 0,
    }


def _judged_early(
    each: GroupRequirement, values: np.ndarray, missed: np.ndarray, unknown: np.ndarray
) -> dict[str, Any]:
    """The verdict of cases that were looked at one after the other, and its bounds.

    A bound may be taken after any number of cases: the tighter one of those when it was decided and in the end.
    """
    assert each.share is not None and each.confidence is not None
    share, confidence = each.share, each.confidence
    number, verdict = sequential.decided(missed, share, confidence)
    looks = [(cases, int(missed[:cases].sum())) for cases in {number, len(values)}]
    statistics = [
        _order_statistic(each, values[:cases], unknown[:cases], sequential.percentile_rank(cases, share, confidence))
        for cases, _ in looks
    ]
    tightest = min if each.comparison.startswith("<") else max
    open_yet = verdict == "not shown"
    return {
        "lower": max(sequential.lower_bound(*look, confidence) for look in looks),
        "upper": min(sequential.upper_bound(*look, confidence) for look in looks),
        "bound": tightest((found for found in statistics if found is not None), default=None),
        "verdict": verdict,
        "more": sequential.cases_needed(share, confidence, int(missed.sum())) - len(values) if open_yet else 0,
        "sequential": True,
        "decided": None if open_yet else number,
    }


def _order_statistic(each: GroupRequirement, values: np.ndarray, unknown: np.ndarray, rank: int) -> float | None:
    """The value of a rank, counted from the limit's side, which bounds the percentile; None where there are too few
    cases, or it falls among those without a value."""
    if not rank:
        return None
    below = each.comparison.startswith("<")
    known = np.where(unknown, np.inf if below else -np.inf, values)
    found = float(np.sort(known)[rank - 1 if below else len(values) - rank])
    return found if np.isfinite(found) else None


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
