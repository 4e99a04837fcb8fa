"""Gradients of metrics as data in xarray."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from batch.archive.layout import coordinate_unit
from met.analysis.linear.gradient import MetricGradients
from met.plan import Experiment
from met.plan.outputs import metric_units

if TYPE_CHECKING:
    import xarray


def to_dataset(experiment: Experiment, gradients: MetricGradients) -> xarray.Dataset:
    """`value` (case, metric) and `slope` (case, metric, number) in SI, with their units, and `why_not`, which is empty
    where there is a slope."""
    import xarray

    why_not = np.full(gradients.slope.shape, "", dtype=object)
    for place, reason in gradients.why_not.items():
        why_not[place] = reason
    units = metric_units(experiment.structure)
    return xarray.Dataset(
        {
            "value": (("case", "metric"), gradients.value),
            "slope": (("case", "metric", "number"), gradients.slope),
            "why_not": (("case", "metric", "number"), why_not.astype(str)),
        },
        {
            "case": list(gradients.cases),
            "metric": list(gradients.metrics),
            "number": list(gradients.paths),
            "unit": ("metric", [units[name] for name in gradients.metrics]),
            "number_unit": (
                "number",
                [coordinate_unit(experiment, coordinate) for coordinate in experiment.cases.coordinates],
            ),
        },
        {"experiment": experiment.name},
    )
