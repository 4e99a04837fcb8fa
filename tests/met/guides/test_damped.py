"""Damped least squares against numpy's, and the bound of the smallest singular value, on random matrices."""

from __future__ import annotations

import numpy as np
import pytest

from met.guides.resolved_rate import damped, gram, least_singular_value
from met.trace import Formulas, Graph

SHAPES = [(2, 2), (2, 5), (3, 3), (3, 7), (6, 6), (6, 7), (6, 9)]


def matrices(rows: int, columns: int, count: int = 60) -> list[np.ndarray]:
    """Random matrices whose singular values span up to five decades; each third has several of nearly one size."""
    random = np.random.default_rng(100 * rows + columns)
    made = []
    for n in range(count):
        left, _ = np.linalg.qr(random.standard_normal((rows, rows)))
        right, _ = np.linalg.qr(random.standard_normal((columns, rows)))
        sizes = 10.0 ** random.uniform(-5.0 if n % 3 else -0.1, 0.0, rows)
        made.append(float(10.0 ** random.uniform(-2, 2)) * left @ np.diag(sizes) @ right.T)
    return made


def solved(J: np.ndarray, damping: float, v: np.ndarray) -> np.ndarray:
    rows = J.tolist()
    return np.array(damped(rows, gram(rows), damping, v.tolist()))


@pytest.mark.slow
@pytest.mark.parametrize(("rows", "columns"), SHAPES)
def test_it_is_the_solution_of_the_damped_least_squares(rows: int, columns: int) -> None:
    random = np.random.default_rng(1)
    for J in matrices(rows, columns):
        size = np.linalg.norm(J, 2)
        v, damping = random.standard_normal(rows), size * 10.0 ** random.uniform(-3.0, 0.0)
        stacked = np.vstack([J, damping * np.eye(columns)])
        expected = np.linalg.lstsq(stacked, np.concatenate([v, np.zeros(columns)]), rcond=None)[0]
        # J J' squares the condition, so roundings grow by (size/damping)^2, 1e6 at most
        np.testing.assert_allclose(solved(J, damping**2, v), expected, rtol=0, atol=1e-8 * np.linalg.norm(expected))


@pytest.mark.parametrize(("rows", "columns"), SHAPES)
def test_without_damping_it_is_the_pseudo_inverse(rows: int, columns: int) -> None:
    random = np.random.default_rng(2)
    tried = 0
    for J in matrices(rows, columns):
        condition = np.linalg.cond(J)
        if condition < 1e4:
            v = random.standard_normal(rows)
            expected = np.linalg.pinv(J) @ v
            error = np.linalg.norm(solved(J, 0.0, v) - expected)
            assert error < 1e-14 * condition**2 * np.linalg.norm(expected)
            tried += 1
    assert tried > 10


@pytest.mark.parametrize(("rows", "columns"), SHAPES)
def test_the_smallest_singular_value_is_never_overstated_and_at_most_seven_percent_less(
    rows: int, columns: int
) -> None:
    worst = 1.0
    for J in matrices(rows, columns):
        exact = np.linalg.svd(J, compute_uv=False)
        found = float(least_singular_value(gram(J.tolist())))
        # RESOLVED is 1e-12 of the sum of squares, so five decades down it is known to a per cent
        assert 0.92 * exact[-1] < found < exact[-1] * 1.0001
        worst = min(worst, found / exact[-1])
    assert worst < 0.999 or rows < 3, "the bound is no equality: some of these matrices have several small values"


@pytest.mark.slow
@pytest.mark.parametrize(("rows", "columns"), SHAPES)
def test_with_the_threshold_as_damping_no_rate_is_larger_than_the_task_over_the_threshold(
    rows: int, columns: int
) -> None:
    # lambda^2 = threshold^2 - sigma^2 below the threshold; a sigma that is understated damps more
    random = np.random.default_rng(3)
    worst = 0.0
    for J in matrices(rows, columns):
        exact = np.linalg.svd(J, compute_uv=False)[-1]
        threshold = exact * 10.0 ** random.uniform(-0.3, 3.0)
        sigma = float(least_singular_value(gram(J.tolist())))
        v = random.standard_normal(rows)
        u = solved(J, max(threshold**2 - sigma**2, 0.0), v)
        worst = max(worst, np.linalg.norm(u) * threshold / np.linalg.norm(v))
    assert worst < 1.0 + 1e-9


def test_where_rows_depend_on_each_other_it_is_nothing_and_a_task_is_done_as_well_as_can_be() -> None:
    J = np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 3.0]])
    assert float(least_singular_value(gram(J.tolist()))) < 1e-5
    assert float(least_singular_value([[0.0] * 3 for _ in range(3)])) == 0.0
    v = np.array([1.0, -1.0, 2.0])
    stacked = np.vstack([J, 0.1 * np.eye(3)])
    expected = np.linalg.lstsq(stacked, np.concatenate([v, np.zeros(3)]), rcond=None)[0]
    np.testing.assert_allclose(solved(J, 0.01, v), expected, rtol=0, atol=1e-12)


def test_what_is_no_number_is_shown() -> None:
    J = [[1.0, float("nan")], [0.0, 1.0]]
    assert np.isnan(float(least_singular_value(gram(J))))
    assert np.isnan(solved(np.array(J), 0.1, np.ones(2))).any()


def test_recorded_it_is_the_same() -> None:
    J, v = matrices(6, 7)[1], np.linspace(-1, 1, 6)
    graph = Graph()
    rows = [[graph.input(f"J{i}{j}") for j in range(7)] for i in range(6)]
    square = gram(rows)
    made = Formulas.of(graph, [*damped(rows, square, 0.01, v.tolist()), least_singular_value(square)])
    found = made.replay({f"J{i}{j}": float(J[i, j]) for i in range(6) for j in range(7)})
    plain = [*solved(J, 0.01, v), float(least_singular_value(gram(J.tolist())))]
    np.testing.assert_allclose(np.array(found, float), plain, rtol=1e-10)
