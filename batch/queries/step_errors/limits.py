"""Judging of requirements on errors due to the step, `require step_error(settle) < 1 %;`, by verified cases."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from batch.queries.signals import deck_unit
from batch.queries.step_errors.figures import CaseError, Verification
from batch.queries.step_errors.words import rounded
from met.frozen import frozen
from met.plan.judged import StepErrorLimit

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup


@frozen
class StepErrorVerdict:
    """The verdict of all verified cases on a requirement on an error due to the step; None where it is not known.

    reason  the worst of them, or why it is not known
    limit   that is required
    cases   verified ones that have a value;  missed: of these
    worst   position in the case table of the worst, -1 where none is verified;  size: its error, SI or a share of its
            value; infinite where it is not known
    """

    text: str
    met: bool | None
    reason: str
    limit: StepErrorLimit
    cases: int = 0
    missed: int = 0
    worst: int = -1
    size: float = math.nan

    @property
    def word(self) -> str:
        """The verdict in a word or two."""
        return {True: "met", False: "missed", None: "not known"}[self.met]


def verdicts(group: ArchiveGroup, verification: Verification | None) -> tuple[StepErrorVerdict, ...]:
    """The verdicts on an experiment's requirements on errors due to the step."""
    return tuple(_verdict(group, step_error, verification) for step_error in group.step_errors)


def _verdict(group: ArchiveGroup, limit: StepErrorLimit, verification: Verification | None) -> StepErrorVerdict:
    """The verdict on one limit of an error by the step: on the largest error of the verified cases."""
    if verification is None:
        return StepErrorVerdict(limit.text, None, "nothing is verified: `met run --verify some`", limit)
    metric = verification.metrics.get(limit.metric)
    cases = [case for case in metric.cases if not _has_none(case)] if metric is not None else []
    if not cases:
        return StepErrorVerdict(limit.text, None, "no verified case has a finite value", limit)
    worst = max(cases, key=lambda case_error: _size(case_error, limit.share))
    size = _size(worst, limit.share)
    missed = sum(not _is_within(_size(case, limit.share), limit) for case in cases)
    if worst.error is None:
        text = worst.why
    elif limit.share:
        text = f"{rounded(100 * size)} %" if size < math.inf else "an error, and a value of 0"
    else:
        scale, unit = deck_unit(group.variables[limit.metric])
        text = f"{rounded(size / abs(scale))} {unit}".removesuffix(" 1")
    among = f", the worst of {len(cases):,} verified cases" if len(cases) > 1 else ""
    text = f"{text} in case #{worst.case}{among}"
    return StepErrorVerdict(limit.text, not missed, text, limit, len(cases), missed, worst.case, size)


def _is_within(size: float, limit: StepErrorLimit) -> bool:
    return size <= limit.limit if limit.comparison == "<=" else size < limit.limit


def _has_none(case: CaseError) -> bool:
    """True where the step cannot cause an error: no value, or the same infinite one for all steps."""
    return math.isnan(case.value) or (math.isinf(case.value) and case.value == case.half == case.quarter)


def _size(case: CaseError, share: bool) -> float:
    """The size of an error: SI, or as a share of the value; infinite where it is not known."""
    if case.error is None or not math.isfinite(case.error.error):
        return math.inf
    if not share or not case.error.error:
        return case.error.error
    return case.error.error / abs(case.value) if case.value else math.inf
