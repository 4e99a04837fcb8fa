"""Warnings about motors on beds whose loops are unstable with the arm that they emulate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ic.meaning.checks.step_words import at_the_start
from ic.text.complaints import Complaints
from met.analysis.memo import AnalysisMemo
from met.diagnostic import Diagnostic, Label, Problem
from met.plan import Experiment

if TYPE_CHECKING:
    from met.analysis.margin import Margin

MOST_CASES = 3
"""Largest number of cases that are examined: each takes some 25 ms."""


def check_beds(complaints: Complaints, experiment: Experiment, memo: AnalysisMemo) -> None:
    """Warn about each joint on a bed that is unstable in the first case, or in one with an extreme value."""
    if not experiment.structure.substitutions or not experiment.cases.count:
        return
    from met.analysis.margin import margins
    from met.analysis.step_size import chosen_cases

    reported: set[str] = set()
    cases = chosen_cases(experiment)[:MOST_CASES]
    left = experiment.cases.count - len(cases)
    try:
        by_case = memo.answer("margins", experiment, lambda: margins(experiment, cases), cases)
    except Problem:  # reported where the program is built
        return
    for margin in (candidate for of_case in by_case for candidate in of_case):
        if not margin.stable and margin.joint not in reported:
            reported.add(margin.joint)
            where = f"reckoned with the arm as it stands {at_the_start(experiment, margin.case)}"
            where += f"; {left:,} of {experiment.cases.count:,} cases were not looked at" if left else ""
            complaints.pass_on(bed_warning(experiment, margin, where))


def bed_warning(experiment: Experiment, margin: Margin, where: str) -> Diagnostic:
    """A warning about a loop that grows. where: the pose and the case, in words"""
    from met.analysis.margin import remedy

    r = margin.least if margin.too_light else margin.together
    if margin.limit == 0.0 or r != r:
        ends = "stable with no arm" if r == r else "no number"
    else:
        ends = f"above {margin.lower:.3g}" if margin.too_light else f"up to {margin.limit:.3g}"
        ends = f"stable {ends}"
    message = (
        f"the loop of joint `{margin.joint}` on its bed is unstable with `{margin.law}` at {margin.rate_hz:.12g} Hz: "
        f"r = {r:.3g}, and it is {ends}"
    )
    place = next(use.place for use in experiment.structure.substitutions if use.joint == margin.joint)
    helps = (f"{remedy(margin)} may help", "`met margin` says it of all cases", where)
    return Diagnostic("D321", message, None if place is None else Label(place), (), helps, "warning")
