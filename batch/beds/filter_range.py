"""Cut-offs of a bed's filter for which its loop is stable, with the arm as a run's cases show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from met.analysis.margin import Margin, margins
from met.frozen import frozen
from met.plan import Experiment, Origin, Quantity

TRIED = 9
"""Number of cut-offs that are tried, spaced geometrically from a hundredth of the servo's rate to half of it."""


@frozen
class FilterRange:
    """The loop with the bed's own filter, and with others.

    own      the tightest margin with the bed's filter, held against the arms of the run;  f_cut: the filter's, Hz
    tried    cut-offs, Hz, and whether the loop is stable there with the margin that was asked
    """

    own: Margin
    f_cut: float
    tried: tuple[tuple[float, bool], ...]

    @property
    def good(self) -> tuple[float, ...]:
        return tuple(f_cut for f_cut, stable in self.tried if stable)


def filter_range(
    experiment: Experiment, joint: str, rows: Sequence[int], ratio: tuple[float, float], margin: float
) -> FilterRange:
    """The filters of a joint's bed. rows: cases to examine; ratio: smallest and largest r over a run. If other joints
    are on beds too, r is that of all their motions at the start instead."""
    alone = len(experiment.structure.substitutions) == 1
    path = f"{joint}.bed.f_cut"

    def tightest(variant: Experiment) -> Margin:
        cases = margins(variant, rows, span=ratio if alone else None, reach=margin)
        return min(
            (margin for case in cases for margin in case if margin.joint == joint), key=lambda margin: margin.room
        )

    own = tightest(experiment)
    value = experiment.parameters[path].value
    tried = []
    for f_cut in np.geomspace(0.01 * own.rate_hz, 0.5 * own.rate_hz, TRIED).tolist():
        parameters = {**experiment.parameters, path: Quantity(f_cut, "Hz", Origin("default"))}
        tightest_margin = tightest(replace(experiment, parameters=parameters))
        tried.append((f_cut, tightest_margin.stable and tightest_margin.room >= margin))
    return FilterRange(own, float(value) if isinstance(value, float | int) else float("nan"), tuple(tried))
