"""Errors due to the step in words: beside a metric's numbers, and in one line beneath them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from batch.queries.signals import number_text
from batch.queries.step_errors.figures import MetricError, Verification

HINT = "not verified: `--verify some` runs some cases at half and a quarter of the step"

NONE = "-"
"""Text in place of an unknown error."""


def error_text(found: MetricError | None, scale: float = 1.0) -> str:
    """An error in two digits, in the unit of size `scale`; NONE where it is not known."""
    if found is None or not math.isfinite(found.error):
        return NONE
    return rounded(found.error / abs(scale))


def rounded(error: float) -> str:
    """An error rounded to two digits."""
    return number_text(float(f"{error:.2g}"))


def about(found: Verification) -> str:
    """A line about the verification, `± by the step: 5 cases at half and a quarter of the step, order 2.0`, with
    remarks."""
    cases = "1 case" if found.cases == 1 else f"{found.cases:,} cases"
    said = f"± by the step: {cases} at half and a quarter of the step"
    orders = sorted(
        {f"{metric.order:.1f}" for metric in found.metrics.values() if metric.clear and math.isfinite(metric.order)}
    )
    if orders:
        said += f", order {_between(orders)}"
    if unclear := [name for name, each in found.metrics.items() if not each.clear]:
        known = [one.error for metric in found.metrics.values() for one in metric.cases if one.error is not None]
        of = f"{sum(not error.clear for error in known):,} of {len(known):,} numbers"
        said += f"; order unclear in {of}, where it is a rough bound: {', '.join(unclear)}"
    for name, each in found.metrics.items():
        if each.unknown:
            where = "" if found.cases == 1 else f" in {each.unknown:,}"
            said += f"; of {name} not known{where}: {each.why}"
    return said


def _between(orders: Sequence[str]) -> str:
    return orders[0] if len(orders) == 1 else f"{orders[0]} to {orders[-1]}"
