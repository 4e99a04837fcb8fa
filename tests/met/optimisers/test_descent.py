"""Descent by slopes comes to minima that are known, in few steps; what it solves on the way obeys its conditions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

from met.optimisers.descent import CONVERGED, LocalModel, SlopeDescent, least_within, updated

Function = Callable[[np.ndarray], LocalModel]


def pieces(values: np.ndarray, slopes: np.ndarray) -> LocalModel:
    """The largest of these, without hinges."""
    n = slopes.shape[1]
    return LocalModel(values, slopes, np.zeros(0), np.zeros((0, n)), np.zeros(0, int), np.zeros(0))


def descended(function: Function, start: np.ndarray) -> tuple[SlopeDescent, int]:
    """A descent at its end, and the number of points it asked for."""
    of, count = SlopeDescent(start, function(start).value, function(start)), 0
    while len(points := of.ask()):
        assert (points >= 0.0).all() and (points <= 1.0).all()
        found = function(points[0])
        of.tell(found.value, found)
        count += 1
    return of, count


@pytest.mark.parametrize("seed", range(40))
def test_what_is_least_within_limits_obeys_the_conditions_of_karush_kuhn_and_tucker(seed: int) -> None:
    draws = np.random.default_rng(seed)
    n, more = int(draws.integers(1, 9)), int(draws.integers(0, 12))
    root = draws.normal(size=(n, int(draws.integers(0, n + 1))))
    curvature, slope = root @ root.T, draws.normal(size=n)
    rows = np.concatenate([draws.normal(size=(more, n)), np.eye(n), -np.eye(n)])
    limits = np.concatenate([draws.random(more), np.ones(2 * n)])
    found = least_within(curvature, slope, rows, limits)
    assert found is not None
    z, multipliers = found
    room = limits - rows @ z
    assert room.min() > -1e-9 and multipliers.min() >= 0.0
    assert np.abs(curvature @ z + slope + rows.T @ multipliers).max() < 1e-9
    assert (room * multipliers).max() < 1e-8


def test_limits_that_leave_nothing_are_told() -> None:
    rows = np.array([[1.0], [-1.0]])
    assert least_within(np.zeros((1, 1)), np.ones(1), rows, np.array([-1.0, -1.0])) is None


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 4, 8])
def test_a_bent_valley_is_followed_to_its_floor(dimension: int) -> None:
    def rosenbrock(point: np.ndarray) -> LocalModel:
        z = 4.0 * point - 2.0
        bend = z[1:] - z[:-1] ** 2
        slope = np.zeros(dimension)
        slope[1:] += 200.0 * bend
        slope[:-1] -= 400.0 * z[:-1] * bend + 2.0 * (1.0 - z[:-1])
        return pieces(np.array([1.0 + (100.0 * bend**2 + (1.0 - z[:-1]) ** 2).sum()]), 4.0 * slope[None])

    of, count = descended(rosenbrock, np.full(dimension, 0.5))
    assert of.converged and of.worth == pytest.approx(1.0, abs=1e-4)
    assert count <= 60


@pytest.mark.parametrize("dimension", [1, 3, 8])
@pytest.mark.parametrize("count", [2, 10, 30])
def test_the_least_of_a_largest_is_that_of_another_solver(dimension: int, count: int) -> None:
    draws = np.random.default_rng(100 * dimension + count)
    centres, scales = draws.random((count, dimension)), 0.3 + draws.random((count, dimension))

    def farthest(point: np.ndarray) -> LocalModel:
        away = scales * (point - centres)
        return pieces((away**2).sum(axis=1) + 0.1, 2.0 * scales * away)

    of, asked = descended(farthest, draws.random(dimension))
    other = minimize(  # type: ignore[call-overload]  # its stubs know no plain dicts
        lambda z: z[-1], np.append(of.point, of.worth + 0.1), method="SLSQP",
        constraints={"type": "ineq", "fun": lambda z: z[-1] - farthest(z[:-1]).pieces},
        bounds=[(0, 1)] * dimension + [(None, None)], options={"ftol": 1e-13, "maxiter": 500},
    )  # fmt: skip
    assert of.converged and of.worth == pytest.approx(other.fun, rel=10 * CONVERGED)
    assert asked <= 15


def test_hinges_hold_a_minimum_at_a_limit() -> None:
    """The nearest point of the plane x + y = 1.2 to (0.3, 0.4) is that moved by 0.25 in each."""

    def beside(point: np.ndarray) -> LocalModel:
        away = point - [0.3, 0.4]
        return LocalModel(
            np.array([1.0 + (away**2).sum()]), 2.0 * away[None], np.array([1.2 - point.sum()]), -np.ones((1, 2)),
            np.zeros(1, int), np.array([100.0]),
        )  # fmt: skip

    of, asked = descended(beside, np.array([0.8, 0.9]))
    assert of.converged and of.point == pytest.approx([0.55, 0.65], abs=2e-3)
    assert of.worth == pytest.approx(1.125, rel=10 * CONVERGED) and asked <= 15


def test_a_corner_of_the_cube_is_reached() -> None:
    of, _ = descended(lambda point: pieces(np.array([point.sum() + 1.0]), np.ones((1, 3))), np.full(3, 0.7))
    assert of.converged and (of.point == 0.0).all()


def test_an_edge_that_the_slopes_do_not_see_ends_it_unsettled_and_keeps_the_best() -> None:
    def jump(point: np.ndarray) -> LocalModel:
        return pieces(np.array([point[0] + (10.0 if point[0] < 0.35 else 1.0)]), np.ones((1, 1)))

    of, asked = descended(jump, np.array([0.9]))
    assert not of.converged and 0.35 <= of.point[0] < 0.351 and asked < 30


def test_where_there_is_no_slope_it_goes_nowhere() -> None:
    start = pieces(np.array([1.0]), np.ones((1, 1)))
    of = SlopeDescent(np.array([0.5]), 1.0, start)
    while len(of.ask()):
        of.tell(float("-inf"), None)
    assert of.point[0] == 0.5 and not of.converged


def test_a_curvature_stays_positive_where_the_slope_changes_backwards() -> None:
    draws = np.random.default_rng(3)
    curvature = np.eye(4)
    for _ in range(50):
        curvature = updated(curvature, draws.normal(size=4), draws.normal(size=4))
        values = np.linalg.eigvalsh(curvature)
        assert values.min() > -1e-14 * values.max()  # but for rounding
