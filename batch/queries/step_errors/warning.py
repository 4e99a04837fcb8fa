"""Warnings about errors due to the step, each with the case, the metric and a sufficient step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from batch.queries.requirements import GroupRequirement, group_requirements
from batch.queries.signals import deck_unit, number_text
from batch.queries.step_errors.figures import COMPARISONS, CaseError, Verification, figures, rounded
from met.analysis.step_error import NEAR, StepError
from met.diagnostic import Diagnostic, warning

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from met.plan import Experiment

MATTERS, LARGE = 0.01, 0.1
"""Shares of a metric's largest value above which an unexplained error, and any error, causes a warning."""

MOST_HALVINGS = 10
"""Largest number of halvings of a step that are proposed as a remedy."""


def warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """Warnings about results of an experiment that are doubtful because of errors due to the step, except those that
    its run allows.

    experiment  of the plan, for places
    """
    verification = figures(group)
    if verification is None:
        return []
    required = group_requirements(group)
    out = [
        _undecided(group, verification, requirement, experiment)
        for requirement in required
        if requirement.metric in verification.metrics
    ]
    of_none = [name for name in verification.metrics if all(requirement.metric != name for requirement in required)]
    out += [_unclear(group, verification, name, experiment) for name in of_none]
    out = [*_lost(verification, experiment), *out]
    return [diagnostic for diagnostic in out if diagnostic is not None and not group.allows(diagnostic.code)]


def _undecided(
    group: ArchiveGroup, verification: Verification, required: GroupRequirement, experiment: Experiment | None
) -> Diagnostic | None:
    """The warning about a requirement whose outcome another step may change."""
    metric = verification.metrics[required.metric]
    those = [(case_error, turned) for case_error in metric.cases if (turned := _turned(case_error, required))]
    if not those:
        return None
    case, turned = max(those, key=lambda pair: _excess(pair[0], required))
    scale, unit = deck_unit(group.variables[required.metric])
    unit = "" if unit == "1" else f" {unit}"
    value = f"{number_text(case.value / scale)}{unit}"
    if case.error is not None and math.isfinite(case.error.error):
        text = f"{value} ± {rounded(case.error.error / abs(scale))}{unit} by the step"
    else:
        text = f"{value} at the step, {turned}"
    margin = abs(case.value - required.limit)
    helps = [
        _remedy(
            verification, case, margin, f"an error below the {number_text(margin / abs(scale))}{unit} that are left"
        )
    ]
    if len(those) > 1:
        helps.append(f"so it is in {len(those):,} of the {verification.cases:,} verified cases")
    message = f"the step decides whether `{required.text}` is met: `{required.metric}` of case #{case.case} is {text}"
    return warning("D310", message, required.written_at(experiment), help=helps)


def _turned(case: CaseError, required: GroupRequirement) -> str:
    """The change of the outcome by a shorter step, or by an error as large as it may be, in words; "" where there is
    none."""
    if math.isnan(case.value):
        return ""
    meets = COMPARISONS[required.comparison]
    own = meets(case.value, required.limit)
    for value, name in ((case.quarter, "a quarter of it"), (case.half, "half of it")):
        if not math.isnan(value) and meets(value, required.limit) != own:
            return f"{'infinite' if math.isinf(value) else 'another value'} at {name}"
    if case.error is not None and case.error.error > abs(case.value - required.limit):
        return "on either side of the limit"
    return ""


def _excess(case: CaseError, required: GroupRequirement) -> float:
    """The ratio of the error to the margin."""
    margin = abs(case.value - required.limit)
    return math.inf if case.error is None or not margin else case.error.error / margin


def _unclear(
    group: ArchiveGroup, verification: Verification, name: str, experiment: Experiment | None
) -> Diagnostic | None:
    """The warning about a metric that changes much with the step, or not in the integrator's order."""
    values = group.values(name)
    size = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    those = [
        case_error
        for case_error in verification.metrics[name].cases
        if case_error.error is not None
        and (LARGE if case_error.error.clear else MATTERS) * size
        < case_error.error.error - case_error.missed
        < math.inf
    ]
    if not those:
        return None
    case = max(those, key=lambda case_error: case_error.error.error if case_error.error is not None else 0.0)
    assert case.error is not None
    scale, unit = deck_unit(group.variables[name])
    unit = "" if unit == "1" else f" {unit}"
    value, half, quarter = (f"{number_text(number / scale)}{unit}" for number in (case.value, case.half, case.quarter))
    message = (
        f"`{name}` of case #{case.case} depends on the step: it is {value}, {half} at half of the step, and "
        f"{quarter} at a quarter"
    )
    helps = [_remedy(verification, case, MATTERS * size, f"an error below {100 * MATTERS:g} %")]
    place = None
    if experiment is not None:
        path = group.variables[name].path
        place = next((use.place for use in experiment.structure.metrics if use.name == path), None)
    return warning("D311", message, place, help=helps)


def _lost(verification: Verification, experiment: Experiment | None) -> list[Diagnostic]:
    """The warning about cases that have metrics at the step, and none with a shorter one."""
    metrics = list(verification.metrics.values())
    those = []
    for row, case in enumerate(metrics[0].cases):
        of_case = [metric.cases[row] for metric in metrics]
        if not all(math.isnan(case_error.value) for case_error in of_case):
            halves, quarters = ([getattr(case_error, share) for case_error in of_case] for share in ("half", "quarter"))
            shares = [share for share, values in ((2, halves), (4, quarters)) if all(map(math.isnan, values))]
            those += [(case.case, shares[0])] if shares else []
    if not those:
        return []
    position, factor = those[0]
    helps = [f"`rates {{ dynamics = {_rate(verification, factor)}; }}` shows why it fails"]
    if len(those) > 1:
        helps.append(f"so it is in {len(those):,} of the {verification.cases:,} verified cases")
    share = "half" if factor == 2 else "a quarter"
    message = (
        f"case #{position} reaches its end at the step of {1e3 * verification.step:g} ms, and does not at {share} of it"
    )
    return [warning("D312", message, None if experiment is None else experiment.place, help=helps)]


def _remedy(verification: Verification, case: CaseError, tolerance: float, wanted: str) -> str:
    """The remedy: the rate of the dynamics at which the error would be so small."""
    if case.error is not None and math.isfinite(case.error.error) and tolerance > 0.0 and _falls(case.error):
        step = case.error.step_for(verification.step, tolerance)
        halvings = max(1, math.ceil(math.log2(verification.step / step))) if step > 0.0 else MOST_HALVINGS + 1
        if halvings <= MOST_HALVINGS:
            return f"`rates {{ dynamics = {_rate(verification, 2**halvings)}; }}` would do, for {wanted}"
    return f"it is not known which step would do; `rates {{ dynamics = {_rate(verification, 4)}; }}` shows more of it"


def _falls(error: StepError) -> bool:
    """True if the error falls as the step does, so that there is a step at which it is small."""
    return error.clear or math.isnan(error.order) or error.order > NEAR


def _rate(verification: Verification, factor: int) -> str:
    """A multiple of the rate of the dynamics."""
    return f"{float(f'{factor / verification.step:.12g}'):.12g} Hz"
