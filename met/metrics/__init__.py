"""Metrics, one a file. To add one: write its file, add it to `METRICS`."""

from met.metrics import final, max, min, overshoot, peak, rms, settling_time
from met.metrics.metric import Metric

METRICS: tuple[Metric, ...] = (
    final.METRIC,
    max.METRIC,
    min.METRIC,
    overshoot.METRIC,
    peak.METRIC,
    rms.METRIC,
    settling_time.METRIC,
)
