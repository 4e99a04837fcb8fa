"""What metrics say of what did not happen: a target that is never reached is neither settled at nor overshot by 0."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from met.metrics.metric import Metric
from met.metrics.overshoot import METRIC as OVERSHOOT
from met.metrics.settling_time import METRIC as SETTLING_TIME


def worth(metric: Metric, course: list[float], **given: float) -> float:
    """The metric of samples a second apart."""
    p = SimpleNamespace(**{each.name: given.get(each.name, each.default) for each in metric.parameters})
    held = {each.name: each.start for each in metric.memory}
    for t, x in enumerate(course):
        held |= metric.update(p, SimpleNamespace(**held), x, float(t), 1.0)
    with np.errstate(divide="ignore"):  # as the engine divides
        return float(metric.result(p, SimpleNamespace(**held), float(len(course) - 1)))


@pytest.mark.parametrize(("course", "share"), [
    ([0.0, 0.5, 1.0, 1.1, 1.0], 0.1),
    ([2.0, 1.0, 0.8, 1.0], 0.2),  # from above
    ([0.0, 1.0, 0.9], 0.0),
    ([0.0, 0.9, 0.985], 0.0),  # dies away towards it: within 2 % of the way
    ([0.0, 1.0, -3.0], 0.0),  # falls back behind where it began
    ([0.0, 0.9, 0.975], math.inf),
    ([0.0, 0.0, 0.0], math.inf),
    ([0.0, -1.0, -2.0], math.inf),  # runs away
    ([2.0, 1.5, 1.1], math.inf),
])  # fmt: skip
def test_an_overshoot_is_of_a_target_that_was_reached(course: list[float], share: float) -> None:
    assert worth(OVERSHOOT, course, target=1.0) == pytest.approx(share, rel=1e-12)


def test_an_overshoot_from_the_target_itself_is_no_number() -> None:
    assert math.isnan(worth(OVERSHOOT, [1.0, 1.5], target=1.0))


def test_a_settling_time_of_what_never_settles_is_infinite_as_well() -> None:
    assert worth(SETTLING_TIME, [0.0, 0.9, 0.975], target=1.0) == math.inf
    assert worth(SETTLING_TIME, [0.0, 0.9, 0.985], target=1.0) == 2.0
