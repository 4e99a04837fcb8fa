"""Warnings of motors on beds whose loops are unstable with the arm that they are to stand for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ic.meaning.checks.step_words import at_the_start
from ic.text.complaints import Complaints
from met.diagnostic import Diagnostic, Label, Problem
from met.plan import Experiment

if TYPE_CHECKING:
    from met.analysis.margin import UnstableBed

MOST_CASES = 3
"""Cases that are looked at: each takes some 30 ms."""


def check_beds(complaints: Complaints, experiment: Experiment) -> None:
    """Warns of each joint on a bed that is unstable in the first case, or where something is least or largest."""
    if not experiment.structure.substitutions or not experiment.cases.count:
        return
    from met.analysis.margin import unstable_beds
    from met.analysis.step_size import chosen_cases

    told: set[str] = set()
    cases = chosen_cases(experiment)[:MOST_CASES]
    left = experiment.cases.count - len(cases)
    for case in cases:
        try:
            found = unstable_beds(experiment, case)
        except Problem:  # said where the program is built
            return
        for each in found:
            if each.joint not in told:
                told.add(each.joint)
                where = f"reckoned with the arm as it stands {at_the_start(experiment, case)}"
                where += f"; {left} of {experiment.cases.count} cases were not looked at" if left else ""
                complaints.pass_on(bed_warning(each, where))


def bed_warning(found: UnstableBed, where: str) -> Diagnostic:
    """A warning of a loop that grows, by `met.analysis.margin`. where: in which pose of which case, in words."""
    rate = f"{found.rate_hz:.12g} Hz"
    weight = "too light" if found.too_light else "too heavy"
    message = (
        f"the loop of joint `{found.joint}` on its bed is unstable with `{found.law}` at {rate}: "
        f"the arm is {weight} for it, r = {found.r:.3g}"
    )
    remedy = (
        "a lower gain of the servo's rate loop, a faster servo or a heavier arm may help"
        if found.too_light
        else "a faster servo, lower gains or another law may help"
    )
    helps = (remedy, "`met margin` says at which r it is stable", where)
    return Diagnostic("D321", message, None if found.place is None else Label(found.place), (), helps, "warning")
