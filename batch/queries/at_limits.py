"""Limits in an archive: the time that cases spent at them, requirements that they affect, and joints beyond them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from batch.queries.requirements import beyond, group_requirements
from batch.queries.signals import deck_unit, number_text
from met.diagnostic import Diagnostic, Label, Place, warning
from met.frozen import frozen
from met.plan.columns import blocks

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from batch.archive.stored import Stored
    from met.plan import Experiment


@frozen
class LimitSummary:
    """A limit over cases.

    limit   path of the parameter that sets it;  about: what the share is of, in words
    cases   how many came to it;  largest: of their shares of the run's time;  row: position of that case
    mostly  how many were there for more than half of the time
    """

    limit: str
    about: str
    cases: int
    largest: float
    row: int
    mostly: int


def limit_summaries(group: ArchiveGroup, among: slice = slice(None)) -> tuple[LimitSummary, ...]:
    """The limits of an experiment, or of some of its cases, in the archive's order; empty for an older archive."""
    first, last, _ = among.indices(group.count)
    summaries = []
    for variable in group.role("limit"):
        worst, largest, cases, mostly = first, -1.0, 0, 0
        for piece in blocks(last - first):
            begin = first + piece.start
            shares = np.nan_to_num(group.stretch(variable.name, begin, first + piece.stop))
            cases, mostly = cases + int((shares > 0.0).sum()), mostly + int((shares > 0.5).sum())
            if (most := float(shares.max())) > largest:
                worst, largest = begin + int(shares.argmax()), most
        row = int(group.at("case", [worst])[0])
        summaries.append(LimitSummary(_described(variable), variable.long_name, cases, largest, row, mostly))
    return tuple(summaries)


def reached_texts(summaries: tuple[LimitSummary, ...], cases: int) -> list[str]:
    """The limits that a case reached, in words: `share of the time at elbow.servo.v_max: 12 %`."""
    out = []
    for summary in summaries:
        if summary.cases:
            share = f"{summary.about}: {100.0 * summary.largest:.3g} %"
            half = f", more than half in {summary.mostly:,}" if summary.mostly else ""
            many = f"at most, in #{summary.row}; not 0 in {summary.cases:,} of {cases:,} cases{half}"
            out.append(share if cases == 1 else f"{share} {many}")
    return out


def warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warnings about limits of an experiment, one of each kind, except those that its run allows.

    experiment  of the plan, for places
    """
    diagnostics = (_judged_at_a_limit(group, experiment), _passed(group, experiment))
    return [diagnostic for diagnostic in diagnostics if diagnostic is not None and not group.allows(diagnostic.code)]


def _judged_at_a_limit(group: ArchiveGroup, experiment: Experiment | None) -> Diagnostic | None:
    """Requirements on extremes that fell at a limit of a machine: the one with most such cases, and the others by
    name."""
    at_extremes = {_described(variable): variable for variable in group.role("extreme")}
    judged = []
    for group_requirement in group_requirements(group):
        variable = at_extremes.get(group.variables[group_requirement.metric].path)
        if variable is not None and (at_limit := group.values(variable.name)).any():
            judged.append((group_requirement, variable, at_limit))
    if not judged:
        return None
    required, variable, at_limit = max(judged, key=lambda judgement: int((judgement[2] > 0).sum()))
    far = np.where(at_limit > 0, beyond(group.values(required.metric), required.comparison, required.limit), -np.inf)
    worst, cases = int(far.argmax()), int((at_limit > 0).sum())
    path = str(variable.attributes["flag_meanings"]).split()[at_limit[worst]]
    many = f", in {cases:,} of {group.count:,} cases, worst in #{group.values('case')[worst]}"
    attributes = group.variables[required.metric].attributes
    message = (
        f"the {attributes.get('model')} of {attributes.get('of')} that `require {required.text}` judges "
        f"fell while `{path}` was reached{many if group.count > 1 else ''}"
    )
    helps = [f"raise `{path}`, or ask for a motion that does not come to it"]
    if len(judged) > 1:
        others = ", ".join(f"`require {other.text}`" for other, _, _ in judged if other is not required)
        helps.append(f"the same of {others}")
    set_at = place_of_parameter(experiment, path)
    also = () if set_at is None else (Label(set_at, "the limit"),)
    return warning("D344", message, required.written_at(experiment), also=also, help=helps)


def _passed(group: ArchiveGroup, experiment: Experiment | None) -> Diagnostic | None:
    """Limits of joints that cases exceed and no requirement judges: the one with most such cases, and the others by
    name."""
    shares = {_described(variable): variable.name for variable in group.role("limit")}
    judged = {
        str(group.variables[group_requirement.metric].attributes.get("of"))
        for group_requirement in group_requirements(group)
    }
    passed = []
    for variable in group.role("excess"):
        excess, joint = np.nan_to_num(group.values(variable.name)), _described(variable).rpartition(".")[0]
        if (excess > 0.0).any() and not {"limits.margin", f"{joint}.limit_margin"} & judged:
            passed.append((int((excess > 0.0).sum()), variable, excess))
    if not passed:
        return None
    cases, variable, excess = max(passed, key=lambda excess_of_limit: excess_of_limit[0])
    path, worst = _described(variable), int(excess.argmax())
    joint, _, name = path.rpartition(".")
    scale, unit = deck_unit(variable)
    many = f" in {cases:,} of {group.count:,} cases, furthest in #{group.values('case')[worst]}:"
    share = f", for {100.0 * group.values(shares[path])[worst]:.3g} % of the time" if path in shares else ""
    message = (
        f"joint `{joint}` passes its limit `{name}`{many if group.count > 1 else ''} by "
        f"{number_text(excess[worst] / scale)} {unit}{share}"
    )
    helps = ["ask for less, mend the limit, or let a requirement judge it: `metric room = min { of = limits.margin; }`"]
    if len(passed) > 1:
        others = ", ".join(f"`{_described(other)}`" for _, other, _ in passed if other is not variable)
        helps.append(f"also passed: {others}")
    return warning("D345", message, place_of_parameter(experiment, path), help=helps)


def place_of_parameter(experiment: Experiment | None, path: str) -> Place | None:
    """The place in the deck of the parameter with this path; None where it is not known."""
    parameter = None if experiment is None else experiment.parameters.get(path)
    return None if parameter is None else parameter.origin.place


def _described(variable: Stored) -> str:
    return str(variable.attributes.get("of", variable.name))
