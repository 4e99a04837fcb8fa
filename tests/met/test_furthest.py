"""What samples may miss of a metric is bounded by the furthest values between them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from met.metrics import METRICS
from met.metrics.metric import Metric, furthest
from tests.met.test_metrics import worth

BY_NAME = {metric.name: metric for metric in METRICS}
GIVEN = {"overshoot": {"target": 100.5}}
EXTREMES = ("max", "peak", "eventually", "overshoot", "min", "always", "never")


def with_furthest(name: str, course: np.ndarray) -> tuple[float, float]:
    """A metric of samples a second apart, and as far as it may be between them."""
    more = furthest(BY_NAME[name])
    assert more is not None
    samples, given = course.tolist(), GIVEN.get(name, {})
    with np.errstate(invalid="ignore"):  # as the engine computes
        return worth(BY_NAME[name], samples, **given), worth(more, samples, **given)


def of_top(name: str, top: float) -> float:
    """The metric of a signal from 100 that goes so far up, or from -100 so far down where small values matter."""
    return {"overshoot": (top - 0.5) / 0.5}.get(
        name, 100.0 + top if name in ("max", "peak", "eventually") else -100.0 - top
    )


def sign(name: str) -> float:
    return -1.0 if name in ("min", "always") else 1.0


@pytest.mark.parametrize("name", EXTREMES)
def test_a_kink_between_samples_is_not_passed_beyond(name: str) -> None:
    """Two straight lines that meet between samples: the bound holds, and is never above the steeper line's rise."""
    random = np.random.default_rng(5)
    for _ in range(100):
        up, down, at = random.uniform(0.1, 1.0), random.uniform(0.1, 30.0), random.uniform(5.0, 6.0)
        t = np.arange(9.0)
        course = 100.0 + np.where(t < at, up * t, up * at - down * (t - at))
        seen, far = with_furthest(name, sign(name) * course)
        true, per_slope = of_top(name, up * at), abs(of_top(name, 1.0) - of_top(name, 0.0))
        assert min(seen, far) - 1e-9 <= true <= max(seen, far) + 1e-9
        assert abs(far - seen) <= per_slope * up * (1.0 + 1e-9), "no more than the slower slope in a step"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["max", "min", "peak"])
def test_the_top_of_a_sine_is_within_it_and_the_bound_falls_with_the_square_of_the_step(name: str) -> None:
    random = np.random.default_rng(6)
    for step in (0.1, 0.01):
        for phase in random.uniform(0.0, 1.0, 20):
            t = np.arange(0.0, 7.0, step) + phase * step
            seen, far = with_furthest(name, np.sin(t))
            true = -1.0 if name == "min" else 1.0
            assert abs(true - seen) <= abs(far - seen) <= 0.6 * step**2


def test_a_jump_does_not_go_on_beyond_its_sample() -> None:
    """A torque at a servo's tick jumps against its slope, and at the next step back again."""
    for course in (
        [0.0, 0.01, 0.02, 5.0, 4.99, 4.98],
        [83.6, 83.5, 83.4, 83.9, 78.7, 78.6, 78.5],
        [0.0, 0.0, 9.0, 9.0, 0.0, 0.0],
    ):
        seen, far = with_furthest("max", np.array(course))
        assert max(course) == seen <= far <= seen + 0.02


def test_an_extreme_at_an_end_of_the_run_is_the_sample_itself() -> None:
    for course in (np.linspace(0.0, 1.0, 9), np.linspace(1.0, 0.0, 9), np.ones(9), np.array([1.0]), np.zeros(0)):
        seen, far = with_furthest("max", course)
        assert seen == far


def test_outside_a_window_nothing_is_missed() -> None:
    """A peak before the window of a condition is none of its margins."""
    course = [0.0, 1.0, 2.0, 1.0, 0.0, -1.0, -2.0, -3.0, -4.0]
    more = furthest(BY_NAME["eventually"])
    assert more is not None
    with np.errstate(invalid="ignore"):
        assert worth(more, course, after=5.0) == worth(BY_NAME["eventually"], course, after=5.0) == -1.0


@pytest.mark.parametrize("name", ["max", "peak", "min"])
def test_outside_the_window_of_an_extreme_nothing_is_missed(name: str) -> None:
    """Kinks before the window and behind it are none of its own."""
    course = sign(name) * np.array([0.0, 1.0, 9.0, 1.0, 0.0, 1.0, 2.0, 1.0, 0.0, 1.0, 9.0, 1.0, 0.0])
    more = furthest(BY_NAME[name])
    assert more is not None
    with np.errstate(invalid="ignore"):
        seen, far = (worth(metric, course.tolist(), after=4.0, within=4.0) for metric in (BY_NAME[name], more))
    assert seen == far == sign(name) * 2.0


def test_a_share_of_time_may_miss_a_sample_at_each_turn() -> None:
    seen, far = with_furthest("share_of_time", np.array([1.0, 1.0, -1.0, -1.0, 1.0, -1.0, -1.0, -1.0]))
    assert seen == 3 / 8 and far == (3 + 3) / 8


def test_what_is_no_extreme_has_none() -> None:
    assert [metric.name for metric in METRICS if furthest(metric) is None] == [
        "final", "rms", "settling_time", "holds_for",
    ]  # fmt: skip


def test_one_step_of_it_is_the_metric_s_own(metric: Metric = BY_NAME["max"]) -> None:
    """The memory of the metric itself takes the same part, so that its parameters and cells are its own."""
    more = furthest(metric)
    assert more is not None and more.memory[: len(metric.memory)] == metric.memory
    held = SimpleNamespace(**{each.name: each.start for each in more.memory})
    with np.errstate(invalid="ignore"):
        assert more.update(SimpleNamespace(after=0.0, within=math.inf), held, 0.25, 0.0, 0.0)["most"] == 0.25
