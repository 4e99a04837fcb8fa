"""Metrics, one a file. To add one: write its file, add it to `METRICS`."""

from met.metrics import (
    always,
    eventually,
    final,
    holds_for,
    max,
    min,
    never,
    overshoot,
    peak,
    rms,
    settling_time,
    share_of_time,
)
from met.metrics.metric import Metric, OverJoints

__all__ = ["METRICS", "Metric", "OverJoints"]

METRICS: tuple[Metric, ...] = (
    final.METRIC,
    max.METRIC,
    min.METRIC,
    overshoot.METRIC,
    peak.METRIC,
    rms.METRIC,
    settling_time.METRIC,
    always.METRIC,
    eventually.METRIC,
    holds_for.METRIC,
    never.METRIC,
    share_of_time.METRIC,
)
