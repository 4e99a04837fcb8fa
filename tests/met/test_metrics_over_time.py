"""Metrics of conditions over time against a monitor that knows nothing of them: it looks at all samples of each window.

The monitor's definitions are those of A. Donze, O. Maler, Robust satisfaction of temporal logic over real-valued
signals, FORMATS 2010, over samples.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from met import models
from met.metrics.metric import Metric

TRACES, SAMPLES, RATE = 1000, 101, 50.0
CLOSE = 1e-12


def margins(seed: int) -> np.ndarray:
    """Random walks about zero, [sample, trace]."""
    steps = np.random.default_rng(seed).normal(size=(SAMPLES, TRACES))
    return np.cumsum(steps, axis=0) * 0.3 + np.linspace(-2.0, 2.0, TRACES)


def worth(name: str, x: np.ndarray, **given: float) -> np.ndarray:
    """The metric of all traces, as the program computes it sample by sample."""
    metric: Metric = models.find("metric", name)
    p = SimpleNamespace(**{each.name: given.get(each.name, each.default) for each in metric.parameters})
    held = {each.name: np.full(x.shape[1], each.start) for each in metric.memory}
    for k, row in enumerate(x):
        held |= metric.update(p, SimpleNamespace(**held), row, k / RATE, 0.0 if k == 0 else 1.0 / RATE)
    with np.errstate(invalid="ignore"):  # as the engine divides
        return np.broadcast_to(metric.result(p, SimpleNamespace(**held), (len(x) - 1) / RATE), x.shape[1:])


def window(x: np.ndarray, first: int, last: int) -> np.ndarray:
    return x[first : last + 1]


@pytest.mark.parametrize(("first", "last"), [(0, SAMPLES - 1), (5, SAMPLES - 1), (7, 35), (100, 100), (35, 200)])
@pytest.mark.parametrize("seed", [1, 2])
def test_margins_are_those_of_all_samples_in_the_window(seed: int, first: int, last: int) -> None:
    x = margins(seed)
    given = {"after": first / RATE, "within": math.inf if last == SAMPLES - 1 else (last - first) / RATE}
    seen = window(x, first, last)
    for name, wanted in (
        ("always", seen.min(axis=0)),
        ("eventually", seen.max(axis=0)),
        ("never", (-seen).min(axis=0)),
        ("share_of_time", (seen >= 0.0).mean(axis=0)),
        ("max", seen.max(axis=0)),
        ("min", seen.min(axis=0)),
        ("peak", np.abs(seen).max(axis=0)),
        ("rms", np.sqrt(np.square(seen).mean(axis=0))),
    ):
        np.testing.assert_allclose(worth(name, x, **given), wanted, rtol=CLOSE, atol=CLOSE, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 3, 7, 10, 100])
@pytest.mark.parametrize("first", [0, 7])
def test_holds_for_is_met_where_every_sample_of_some_stretch_is(steps: int, first: int) -> None:
    x = margins(3)
    seen = window(x, first, SAMPLES - 1) >= 0.0
    starts = range(len(seen) - steps)
    holds = np.any([seen[k : k + steps + 1].all(axis=0) for k in starts], axis=0) if starts else np.zeros(TRACES, bool)
    found = worth("holds_for", x, time=steps / RATE, after=first / RATE)
    np.testing.assert_array_equal(found >= 0.0, holds)
    longest = [max((len(run) for run in "".join("01"[int(s)] for s in t).split("0")), default=0) for t in seen.T]
    wanted = np.maximum(np.array(longest) - 1, 0) / RATE - steps / RATE
    np.testing.assert_allclose(found, wanted, rtol=CLOSE, atol=CLOSE)
    assert 0 < holds.sum() < TRACES or steps == 100


@pytest.mark.parametrize(
    "name", ["always", "eventually", "never", "share_of_time", "holds_for", "max", "min", "peak", "rms"]
)
def test_a_window_without_a_sample_gives_no_number(name: str) -> None:
    x = margins(4)[:10]
    assert np.isnan(worth(name, x, after=1.0, time=0.1)).all()
    assert not np.isnan(worth(name, x, after=9 / RATE, time=0.1)).any()


def test_ends_of_a_window_are_decimals() -> None:
    """0.7 s and 0.1 s are 0.8 s, although their doubles add up to less."""
    x = np.zeros((SAMPLES, 1))
    x[40] = -1.0  # t = 0.8 s
    assert 40 / RATE > 0.7 + 0.1
    assert worth("always", x, after=0.7, within=0.1) == -1.0
    assert worth("always", x, after=0.7, within=0.09) == 0.0
    for first in range(60):
        stretch = np.full((SAMPLES, 1), -1.0)
        stretch[first : first + 11] = 1.0
        assert worth("holds_for", stretch, time=0.2) == 0.0


@pytest.mark.parametrize("name", ["always", "eventually", "never"])
def test_what_is_not_a_number_stays_so(name: str) -> None:
    x = margins(5)[:, :1].copy()
    x[50] = math.nan
    assert np.isnan(worth(name, x)).all()
    assert not np.isnan(worth(name, x, within=0.5)).any()
