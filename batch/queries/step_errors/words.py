"""Errors due to the step in words: beside a metric's numbers, and in one line beneath them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from batch.queries.signals import number_text
from batch.queries.step_errors.figures import MetricError, Verification

HINT = "not verified: `--verify some` runs some cases at half and a quarter of the step"

NONE = "-"
"""Text in place of an unknown error."""


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
    cases = "1 case" if verification.cases == 1 else f"{verification.cases:,} cases"
    text = f"± by the step: {cases} at half and a quarter of the step"
    orders = sorted(
        {
            f"{metric.order:.1f}"
            for metric in verification.metrics.values()
            if metric.clear and math.isfinite(metric.order)
        }
    )
    if orders:
        text += f", order {_between(orders)}"
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


def _between(orders: Sequence[str]) -> str:
    return orders[0] if len(orders) == 1 else f"{orders[0]} to {orders[-1]}"
