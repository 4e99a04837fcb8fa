"""Limits in an archive: the time that cases spent at them, requirements that they affect, and joints beyond them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from batch.queries.requirements import beyond, group_requirements
from batch.queries.signals import deck_unit, number_text
from met.diagnostic import Diagnostic, Label, Place
from met.frozen import frozen
from met.plan.swept import blocks

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


def limit_summaries(group: ArchiveGroup, here: slice = slice(None)) -> tuple[LimitSummary, ...]:
    """The limits of an experiment, or of some of its cases, in the archive's order; empty for an older archive."""
    first, last, _ = here.indices(group.count)
    found = []
    for variable in group.role("limit"):
        worst, largest, cases, mostly = first, -1.0, 0, 0
        for piece in blocks(last - first):
            begin = first + piece.start
            shares = np.nan_to_num(group.stretch(variable.name, begin, first + piece.stop))
            cases, mostly = cases + int((shares > 0.0).sum()), mostly + int((shares > 0.5).sum())
            if (most := float(shares.max())) > largest:
                worst, largest = begin + int(shares.argmax()), most
        row = int(group.at("case", [worst])[0])
        found.append(LimitSummary(_of(variable), variable.long_name, cases, largest, row, mostly))
    return tuple(found)


def reached_texts(found: tuple[LimitSummary, ...], cases: int) -> list[str]:
    """The limits that a case reached, in words: `share of the time at elbow.servo.v_max: 12 %`."""
    out = []
    for each in found:
        if each.cases:
            of = f"{each.about}: {100.0 * each.largest:.3g} %"
            half = f", more than half in {each.mostly:,}" if each.mostly else ""
            many = f"at most, in #{each.row}; not 0 in {each.cases:,} of {cases:,} cases{half}"
            out.append(of if cases == 1 else f"{of} {many}")
    return out


def warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warnings about limits of an experiment, one of each kind, except those that its run allows.

    experiment  of the plan, for places
    """
    found = (_judged_at_a_limit(group, experiment), _passed(group, experiment))
    return [each for each in found if each is not None and not group.allows(each.code)]


def _judged_at_a_limit(group: ArchiveGroup, experiment: Experiment | None) -> Diagnostic | None:
    """Requirements on extremes that fell at a limit of a machine: the one with most such cases, and the others by
    name."""
    at_extremes = {_of(variable): variable for variable in group.role("extreme")}
    judged = []
    for group_requirement in group_requirements(group):
        variable = at_extremes.get(group.variables[group_requirement.metric].path)
        if variable is not None and (at := group.values(variable.name)).any():
            judged.append((group_requirement, variable, at))
    if not judged:
        return None
    required, variable, at = max(judged, key=lambda found: int((found[2] > 0).sum()))
    far = np.where(at > 0, beyond(group.values(required.metric), required.comparison, required.limit), -np.inf)
    worst, cases = int(far.argmax()), int((at > 0).sum())
    path = str(variable.attributes["flag_meanings"]).split()[at[worst]]
    many = f", in {cases:,} of {group.count:,} cases, worst in #{group.values('case')[worst]}"
    told = group.variables[required.metric].attributes
    message = (
        f"the {told.get('model')} of {told.get('of')} that `require {required.text}` judges fell while `{path}` was "
        f"reached{many if group.count > 1 else ''}"
    )
    helps = [f"raise `{path}`, or ask for a motion that does not come to it"]
    if len(judged) > 1:
        others = ", ".join(f"`require {each.text}`" for each, _, _ in judged if each is not required)
        helps.append(f"the same of {others}")
    place = None if experiment is None else experiment.requirements[required.place].place
    set_at = _place(experiment, path)
    also = () if set_at is None else (Label(set_at, "the limit"),)
    return Diagnostic("D344", message, None if place is None else Label(place), also, tuple(helps), "warning")


def _passed(group: ArchiveGroup, experiment: Experiment | None) -> Diagnostic | None:
    """Limits of joints that cases exceed and no requirement judges: the one with most such cases, and the others by
    name."""
    shares = {_of(variable): variable.name for variable in group.role("limit")}
    judged = {
        str(group.variables[group_requirement.metric].attributes.get("of"))
        for group_requirement in group_requirements(group)
    }
    passed = []
    for variable in group.role("excess"):
        excess, joint = np.nan_to_num(group.values(variable.name)), _of(variable).rpartition(".")[0]
        if (excess > 0.0).any() and not {"limits.margin", f"{joint}.limit_margin"} & judged:
            passed.append((int((excess > 0.0).sum()), variable, excess))
    if not passed:
        return None
    cases, variable, excess = max(passed, key=lambda each: each[0])
    path, worst = _of(variable), int(excess.argmax())
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
        others = ", ".join(f"`{_of(each)}`" for _, each, _ in passed if each is not variable)
        helps.append(f"also passed: {others}")
    place = _place(experiment, path)
    return Diagnostic("D345", message, None if place is None else Label(place), (), tuple(helps), "warning")


def _place(experiment: Experiment | None, path: str) -> Place | None:
    """The place of a limit in the deck."""
    found = None if experiment is None else experiment.parameters.get(path)
    return None if found is None else found.origin.place


def _of(variable: Stored) -> str:
    return str(variable.attributes.get("of", variable.name))
