"""Cases of one design point share all that was chosen."""

from __future__ import annotations

import numpy as np

from met.statistics.design_points import design_points


def test_points_are_numbered_as_they_first_appear() -> None:
    gains, masses = np.array([2.0, 2.0, 1.0, 1.0, 2.0]), np.array([5.0, 6.0, 5.0, 5.0, 5.0])
    assert design_points([gains, masses], 5).tolist() == [0, 1, 2, 2, 0]
    assert design_points([], 3).tolist() == [0, 0, 0]


def test_many_coordinates_of_many_values_are_no_problem() -> None:
    rng = np.random.default_rng(5)
    table = rng.integers(0, 50, (2_000, 12)).astype(float)
    rows = {tuple(row): number for number, row in reversed(list(enumerate(table.tolist())))}
    points = design_points(list(table.T), len(table))
    assert len(set(points.tolist())) == len(rows)
    assert all(rows[tuple(row)] == np.flatnonzero(points == point)[0] for row, point in zip(table, points, strict=True))
