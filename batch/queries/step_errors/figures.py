"""Errors due to the step, from a metric's values at the step, half and a quarter of it; their limits; their words."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from batch.queries.signals import deck_unit, number_text
from ic.printing.columns import count
from met.analysis.step_error import StepError, instant_error, step_error
from met.frozen import frozen
from met.plan.judged import StepErrorLimit

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from batch.archive.verified import Verified

COMPARISONS = MappingProxyType({"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge})


@frozen
class CaseError:
    """The error of a metric in a case; None where it cannot be known, and why.

    case    position in the case table;  value, half, quarter: the metric at the step and these shares of it, SI
    missed  part of the error that the three do not show, SI: what may lie between samples
    """

    case: int
    value: float
    half: float
    quarter: float
    error: StepError | None
    why: str = ""
    missed: float = 0.0


@frozen
class MetricError:
    """The error of a metric by the step over a campaign: the largest of its verified cases.

    error    SI; not a number where it is known of none;  case: of which it is, position in the case table
    order    observed there, not a number where none is;  clear: whether all have the order that they should
    unknown  cases of which it is not known;  why: of the first of them
    cases    each of the verified ones
    """

    error: float
    case: int
    order: float
    clear: bool
    unknown: int
    why: str
    cases: tuple[CaseError, ...]


@frozen
class Verification:
    """The accuracy of an experiment's numbers. cases: verified ones; order: the integrator's; step: s; metrics: by the
    names of their variables"""

    cases: int
    order: int
    step: float
    metrics: Mapping[str, MetricError]


def figures(group: ArchiveGroup, position: int | None = None) -> Verification | None:
    """The accuracy of the numbers of an archive's experiment, or of its case at this position; None where it was not
    verified."""
    verified = group.verified
    if verified is None:
        return None
    places = np.array([group.position_of(int(case)) for case in verified.cases])
    rows = range(len(places)) if position is None else np.flatnonzero(places == position).tolist()
    if not rows:
        return None
    own = {name: group.at(name, places) for name in verified.metrics}
    return Verification(
        len(rows),
        verified.order,
        verified.step,
        {name: _of_metric(verified, column, own[name], list(rows)) for column, name in enumerate(verified.metrics)},
    )


def _of_metric(verified: Verified, column: int, own: np.ndarray, rows: list[int]) -> MetricError:
    """The error by the step of a metric, by its column: the largest of the verified cases in these rows."""
    half, quarter, missed = verified.half[:, column], verified.quarter[:, column], verified.missed[:, column]
    instant = float(verified.instant[column])
    errors = tuple(
        case_error(
            int(verified.cases[n]),
            (float(own[n]), float(half[n]), float(quarter[n])),
            verified.order,
            instant,
            float(missed[n]),
        )
        for n in rows
    )
    known = [(case_error_.error, case_error_.case) for case_error_ in errors if case_error_.error is not None]
    lost = [case_error_ for case_error_ in errors if case_error_.error is None]
    if not known:
        return MetricError(math.nan, -1, math.nan, True, len(lost), lost[0].why, errors)
    worst, case = max(known, key=lambda pair: pair[0].error)
    clear = all(error.clear for error, _ in known)
    return MetricError(worst.error, case, worst.order, clear, len(lost), lost[0].why if lost else "", errors)


def case_error(
    case: int, values: tuple[float, float, float], order: int, instant: float, missed: float = 0.0
) -> CaseError:
    """The error of a metric in a case, from its values at the step, half and a quarter of it, SI.

    order    of the integrator;  instant: s, a quarter of the step where the metric is an instant seen at whole steps
    missed   what lies between samples at a quarter of the step, as `Verified` has it
    """
    own, half, quarter = values
    names = ("at the step", "at half the step", "at a quarter of the step")
    for value, name in zip(values, names, strict=True):
        if math.isnan(value):
            return CaseError(case, own, half, quarter, None, f"no value {name}")
    if math.isinf(own) and own == half == quarter:
        return CaseError(case, own, half, quarter, None, "infinite at every step")
    for value, name in zip(values, names, strict=True):
        if math.isinf(value):
            return CaseError(case, own, half, quarter, None, f"infinite {name}, and not at another")
    first, second = abs(own - half), abs(half - quarter)
    if instant:
        return CaseError(case, own, half, quarter, instant_error(first, second, abs(own - quarter), instant))
    return CaseError(case, own, half, quarter, step_error(first, second, abs(own), order, missed), missed=missed)


def together(verifications: Iterable[Verification | None]) -> Verification | None:
    """The figures of several structures as those of one experiment: for each metric that of its worst case."""
    those = [verification for verification in verifications if verification is not None]
    if len(those) < 2:
        return those[0] if those else None
    metrics: dict[str, MetricError] = {}
    for verification in those:
        for name, metric_error in verification.metrics.items():
            metrics[name] = _worse(metrics[name], metric_error) if name in metrics else metric_error
    first = those[0]
    return Verification(sum(verification.cases for verification in those), first.order, first.step, metrics)


def _worse(metric_error: MetricError, other: MetricError) -> MetricError:
    """The worse of the errors of two groups of cases, with the counts of both."""
    worst = other if math.isnan(metric_error.error) or other.error > metric_error.error else metric_error
    return replace(
        worst,
        clear=metric_error.clear and other.clear,
        unknown=metric_error.unknown + other.unknown,
        why=metric_error.why or other.why,
        cases=metric_error.cases + other.cases,
    )


def of_difference(a: Verification | None, b: Verification | None) -> dict[str, float]:
    """The errors due to the step of differences between two archives' metrics, SI: the sums of those that are known."""
    known: dict[str, float] = {}
    for verification in (a, b):
        for name, metric_error in verification.metrics.items() if verification is not None else ():
            if math.isfinite(metric_error.error):
                known[name] = known.get(name, 0.0) + metric_error.error
    return known


def as_json(verification: Verification | None) -> dict[str, Any] | None:
    """Plain data of a verification; missing numbers are not-a-number."""
    if verification is None:
        return None
    metrics = {
        name: {
            "error": metric_error.error,
            "case": None if metric_error.case < 0 else metric_error.case,
            "order": metric_error.order,
            "clear": metric_error.clear,
            "unknown": metric_error.unknown,
            "why": metric_error.why,
        }
        for name, metric_error in verification.metrics.items()
    }
    return {"cases": verification.cases, "order": verification.order, "step": verification.step, "metrics": metrics}


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
    missed = sum(not COMPARISONS[limit.comparison](_size(case, limit.share), limit.limit) for case in cases)
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


HINT = "not verified: `--verify some` runs some cases at half and a quarter of the step"

NONE = "-"
"""Text in place of an error, or another number, that is not known."""


def error_text(metric_error: MetricError | None, scale: float = 1.0) -> str:
    """An error in two digits, in the unit of size `scale`; NONE where it is not known."""
    if metric_error is None or not math.isfinite(metric_error.error):
        return NONE
    return rounded(metric_error.error / abs(scale))


def rounded(error: float) -> str:
    """An error rounded to two digits."""
    return number_text(float(f"{error:.2g}"))


def about(verification: Verification) -> str:
    """A line about the verification, `± by the step: 5 cases at half and a quarter of the step, order 2.0`, with
    remarks."""
    text = f"± by the step: {count(verification.cases, 'case')} at half and a quarter of the step"
    orders = sorted(
        {
            f"{metric.order:.1f}"
            for metric in verification.metrics.values()
            if metric.clear and math.isfinite(metric.order)
        }
    )
    if orders:
        text += f", order {' to '.join(dict.fromkeys((orders[0], orders[-1])))}"
    if unclear := [name for name, metric_error in verification.metrics.items() if not metric_error.clear]:
        known = [
            case_error.error
            for metric in verification.metrics.values()
            for case_error in metric.cases
            if case_error.error is not None
        ]
        unclear_text = f"{sum(not error.clear for error in known):,} of {len(known):,} numbers"
        text += f"; order unclear in {unclear_text}, where it is a rough bound: {', '.join(unclear)}"
    for name, metric in verification.metrics.items():
        if metric.unknown:
            where = "" if verification.cases == 1 else f" in {metric.unknown:,}"
            text += f"; of {name} not known{where}: {metric.why}"
    return text
