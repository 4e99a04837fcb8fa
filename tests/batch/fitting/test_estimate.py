"""Estimation of numbers, on models that are formulas: what is found, how sure, and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from batch.fitting.estimate import Fit, Fitter, Prior
from batch.fitting.known import known
from batch.fitting.logged import LoggedRuns
from met.frozen import frozen

TIME = np.linspace(0.0, 10.0, 600)
TRUTH = np.array([2.0, 0.5])

Model = Callable[[np.ndarray], np.ndarray]


@frozen
class Formula(LoggedRuns):
    """A model that is a formula, with measured numbers. least: of each parameter, below which it is refused"""

    model: Model
    log: np.ndarray
    least: float = -np.inf

    @property
    def measured(self) -> np.ndarray:  # type: ignore[override]
        return self.log

    @property
    def signal_of(self) -> np.ndarray:  # type: ignore[override]
        return np.zeros(len(self.log), dtype=np.int64)

    @property
    def stretch_of(self) -> np.ndarray:  # type: ignore[override]
        return np.arange(len(self.log)) * 24 // len(self.log)

    def residuals(self, values: np.ndarray) -> np.ndarray:
        computed = np.array([self.model(each) for each in values])
        computed[self.refused(values)] = np.nan
        return self.log - computed

    def refused(self, values: np.ndarray) -> np.ndarray:
        return np.asarray((values < self.least).any(axis=1))


def spring(values: np.ndarray) -> np.ndarray:
    """A swing of which frequency and decay are estimated."""
    frequency, decay = values
    return np.asarray(np.exp(-decay * TIME) * np.cos(frequency * TIME))


def fitted(
    noise: np.ndarray,
    start: tuple[float, float] = (1.9, 0.3),
    priors: dict[str, Prior] | None = None,
    least: float = -np.inf,
    model: Model = spring,
    truth: np.ndarray = TRUTH,
) -> Fit:
    logs = Formula((), ("frequency", "decay"), model, model(truth) + noise, least)
    return Fitter(logs, np.array(start), priors or {}).fit()


def white(seed: int) -> np.ndarray:
    return 0.02 * np.random.default_rng(seed).standard_normal(len(TIME))


def slow(seed: int) -> np.ndarray:
    """Noise whose correlation with the next instant is 0.9."""
    noise, draws = np.zeros(len(TIME)), 0.01 * np.random.default_rng(seed).standard_normal(len(TIME))
    for number in range(1, len(noise)):
        noise[number] = 0.9 * noise[number - 1] + draws[number]
    return noise


def test_without_noise_the_truth_is_found() -> None:
    fit = fitted(np.zeros(len(TIME)))
    assert fit.values == pytest.approx(TRUTH, rel=1e-6) and fit.converged and fit.rival is None


@pytest.mark.slow
@pytest.mark.parametrize("noise", [white, slow])
def test_intervals_hold_the_truth_about_as_often_as_they_say(noise: Callable[[int], np.ndarray]) -> None:
    held = 0
    for seed in range(60):
        fit = fitted(noise(seed))
        held += int(np.sum(np.abs(fit.values - TRUTH) <= fit.factor * fit.deviation))
    assert 106 <= held <= 120  # of 120; 95 % are 114, and 106 or fewer happen once in a thousand


def test_intervals_are_those_of_least_squares_where_noise_is_white() -> None:
    fit = fitted(white(1))
    slope = np.array([
        (spring(TRUTH + step) - spring(TRUTH - step)) / 2e-5 for step in np.diag([1e-5, 1e-5])
    ])  # fmt: skip
    expected = 0.02 * np.sqrt(np.diag(np.linalg.inv(slope @ slope.T)))
    assert np.all(fit.deviation > 0.9 * expected) and np.all(fit.deviation < 1.6 * expected)


def test_a_prior_pulls_by_what_it_is_worth() -> None:
    alone = fitted(white(2))
    strong = fitted(white(2), priors={"decay": Prior(0.6, 1e-6)})
    weak = fitted(white(2), priors={"decay": Prior(0.6, 10.0)})
    assert strong.values[1] == pytest.approx(0.6, abs=1e-5) and strong.deviation[1] < 2e-6
    assert weak.values == pytest.approx(alone.values, rel=1e-3)


def test_a_value_ends_where_no_other_is_allowed_and_has_no_interval() -> None:
    fit = fitted(white(3), start=(1.9, 0.9), least=0.7)
    assert fit.values[1] == pytest.approx(0.7, abs=1e-6) and fit.at_limit.tolist() == [False, True]
    assert np.isnan(fit.deviation[1]) and fit.deviation[0] > 0.0


def test_few_numbers_far_from_all_others_are_left_out() -> None:
    noise = white(4)
    noise[[50, 51, 400]] += 5.0
    fit = fitted(noise)
    assert fit.outliers >= 3 and np.all(np.abs(fit.values - TRUTH) <= 1.5 * fit.factor * fit.deviation)


def test_events_do_not_tell_numbers_apart_of_which_only_the_sum_is_seen() -> None:
    def stepped(values: np.ndarray) -> np.ndarray:
        return np.asarray(np.round((values[0] + 3.0 * values[1]) * np.cos(TIME), 4))

    logs = Formula((), ("mass", "com"), stepped, stepped(np.array([8.0, 0.5])) + white(6))
    fitter = Fitter(logs, np.array([8.0, 0.5]), {})
    found = known(fitter.slopes_at_start(np.array([0.02])), fitter.size, np.zeros(2, bool))
    assert found.verdict == ("tied", "tied") and found.rank == 1
    assert found.alone == pytest.approx(0.02 / np.sqrt(np.sum(np.cos(TIME) ** 2)) / np.array([1.0, 3.0]), rel=0.2)


def test_another_answer_that_explains_the_log_as_well_is_told() -> None:
    def either(values: np.ndarray) -> np.ndarray:
        return np.asarray((values[0] - 2.0) ** 2 * np.cos(TIME) + values[1] * np.sin(TIME))

    fit = fitted(white(5), start=(2.4, 0.3), model=either, truth=np.array([2.5, 0.5]))
    assert fit.rival is not None and sorted([fit.values[0], fit.rival[0]]) == pytest.approx([1.5, 2.5], abs=0.02)
