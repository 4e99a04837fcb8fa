"""The step's error, from differences of which it is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from met.analysis.step_error import StepError, instant_error, step_error


def differences(order: float, c: float, h: float, higher: float = 0.0) -> tuple[float, float, float]:
    """|x(h) - x(h/2)|, |x(h/2) - x(h/4)| and the true error of x(h) = 1 + c h^order + higher h^(order + 1)."""

    def error(h: float) -> float:
        return c * h**order + higher * h ** (order + 1)

    return abs(error(h) - error(h / 2)), abs(error(h / 2) - error(h / 4)), abs(error(h))


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_power_of_the_step_is_found_to_rounding(order: int) -> None:
    first, second, error = differences(order, -3.0, 0.01)
    found = step_error(first, second, 1.0, order)
    assert found.clear and found.order == pytest.approx(order, abs=1e-6)
    assert found.error == pytest.approx(error, rel=1e-6)
    wanted = found.step_for(0.01, error / 100)
    assert differences(order, -3.0, wanted)[2] == pytest.approx(error / 100, rel=1e-5)


def test_a_number_seen_once_a_step_is_of_order_one_whatever_the_integrator() -> None:
    first, second, error = differences(1, 2.0, 0.01)
    assert step_error(first, second, 1.0, 2).error == pytest.approx(error, rel=1e-9)


def test_a_step_too_long_for_its_order_is_bounded_and_called_unclear() -> None:
    for ratio in (0.5, 1.0, 30.0):
        found = step_error(ratio, 1.0, 1.0, 2)
        assert not found.clear and found.error == 3.0 * max(ratio, 1.0)
        assert found.step_for(0.1, 0.3) < 0.1 * 0.3 / found.error * 1.01


def test_what_lies_between_samples_is_added_whatever_the_order() -> None:
    for first, second in ((4e-3, 1e-3), (1.0, 1.0), (1.0, 0.0), (1e-15, 0.0)):
        assert step_error(first, second, 1.0, 2, 0.5).error == step_error(first, second, 1.0, 2).error + 0.5


def test_rounding_has_no_order() -> None:
    found = step_error(1e-15, 3e-15, 1.0, 2)
    assert found == StepError(3e-15, pytest.approx(math.nan, nan_ok=True), True)
    assert step_error(0.0, 0.0, 0.0, 2).error == 0.0


def test_what_is_not_finite_has_no_error_that_could_be_met() -> None:
    assert step_error(math.nan, 1.0, 1.0, 2).error == math.inf
    assert step_error(1.0, np.inf, 1.0, 2).error == math.inf


def test_an_instant_that_is_seen_at_whole_steps_is_bounded() -> None:
    """The first step at or after an instant, where the integration errs by c h^2: never off by more than is said."""
    random = np.random.default_rng(2)
    for _ in range(500):
        h, c, true = random.uniform(0.01, 0.1), random.normal(), random.uniform(1.0, 2.0)
        values = [math.ceil((true + c * (h / n) ** 2) * n / h) * h / n for n in (1, 2, 4)]
        first, second, both = (abs(values[a] - values[b]) for a, b in ((0, 1), (1, 2), (0, 2)))
        found = instant_error(first, second, both, h / 4)
        assert math.isnan(found.order)
        assert abs(values[0] - true) <= found.error + abs(c) * (h / 4) ** 2
    assert instant_error(0.0, 0.0, 0.0, 0.01) == StepError(0.01, pytest.approx(math.nan, nan_ok=True), True)
    assert not instant_error(0.04, 0.08, 0.04, 0.01).clear
    assert instant_error(math.inf, 0.0, 0.0, 0.01).error == math.inf
