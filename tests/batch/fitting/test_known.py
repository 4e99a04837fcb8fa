"""What logs can tell of parameters: rank, condition, and which parameters go together."""

from __future__ import annotations

import numpy as np
import pytest

from batch.fitting.known import correlated, known

NONE_HELD = np.zeros(2, dtype=bool)


def columns(count: int) -> np.ndarray:
    """Orthonormal columns, [50, count]."""
    return np.asarray(np.linalg.qr(np.random.default_rng(3).standard_normal((50, count)))[0])


def test_parameters_with_marks_of_their_own_are_known_as_their_marks_say() -> None:
    found = known(columns(2) * [20.0, 500.0], np.array([1.0, 2.0]), NONE_HELD)
    assert found.verdict == ("known", "known") and found.rank == 2 and not found.together
    assert found.deviation == pytest.approx([0.05, 0.002]) and found.alone == pytest.approx([0.05, 0.002])
    assert found.condition == pytest.approx(50.0)


def test_parameters_with_one_mark_are_tied_and_their_change_together_is_named() -> None:
    mark = columns(1)
    found = known(np.hstack([100.0 * mark, 25.0 * mark]), np.array([2.0, 8.0]), NONE_HELD)
    assert found.verdict == ("tied", "tied") and found.rank == 1
    (change,) = found.together
    assert 100.0 * change[0] + 25.0 * change[1] == pytest.approx(0.0, abs=1e-9)
    assert max(abs(change[0]) / 2.0, abs(change[1]) / 8.0) == pytest.approx(1.0)
    assert found.alone == pytest.approx([0.01, 0.04])


def test_a_change_of_which_one_part_is_much_the_largest_is_named_whole() -> None:
    direction = np.array([0.09, -0.09, 1.0])
    _, _, right = np.linalg.svd(direction[None, :])
    found = known(np.array([[0.0], [1e3], [1e3]]) * right, np.ones(3), np.zeros(3, bool))
    (together,) = found.together
    assert found.verdict == ("tied",) * 3 and together == pytest.approx({0: 0.09, 1: -0.09, 2: 1.0})


def test_a_parameter_without_a_mark_is_unseen_and_does_not_tie_others() -> None:
    found = known(np.hstack([columns(1) * 100.0, np.zeros((50, 1))]), np.array([1.0, 1.0]), NONE_HELD)
    assert found.verdict == ("known", "unseen") and not found.together
    assert np.isinf(found.deviation[1]) and np.isinf(found.condition)


def test_a_parameter_of_which_no_other_value_is_allowed_is_held() -> None:
    found = known(columns(2) * 100.0, np.array([1.0, 1.0]), np.array([False, True]))
    assert found.verdict == ("known", "held")


def test_standard_errors_are_wider_where_residuals_are_correlated() -> None:
    assert known(columns(2) * 100.0, np.ones(2), NONE_HELD, 3.0).deviation == pytest.approx([0.03, 0.03])


def test_estimates_that_go_together_are_named_with_their_correlation() -> None:
    covariance = np.array([[4.0, -5.7, np.nan], [-5.7, 9.0, np.nan], [np.nan, np.nan, np.nan]])
    found = known(np.hstack([columns(2) * 100.0, np.zeros((50, 1))]), np.ones(3), np.zeros(3, dtype=bool))
    assert list(correlated(covariance, ["a", "b", "c"], found)) == [("a", "b", pytest.approx(-0.95))]
