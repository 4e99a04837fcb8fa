"""Rows of two archives that belong together: `batch/differences/matching.py`."""

from __future__ import annotations

import numpy as np
import pytest

from batch.differences.matching import match_instants


@pytest.mark.parametrize(
    ("a", "b", "early", "pairs"),
    [
        ([0.0, 1.0], [0.0, 1.0], 0.0, [(0, 0), (1, 1)]),
        ([0.0, 1.0], [0.0, 1.0005], 0.0, [(0, 0)]),
        ([0.0, 1.0], [0.0, 1.0 + 5e-10], 0.0, [(0, 0), (1, 1)]),
        ([0.0, 1.0], [0.0, 1.0 + 2e-9], 0.0, [(0, 0)]),
        ([0.0, 1000.0], [0.0, 1000.0 + 5e-7], 0.0, [(0, 0), (1, 1)]),
        ([0.0, 1.0], [5e-13, 2.0], 0.0, [(0, 0)]),
        ([0.0, 1.0], [5e-12, 2.0], 0.0, []),
        ([0.0, 1.0], [0.0, 1.01], 0.02, [(0, 0), (1, 1)]),
        ([0.0, 1.0], [0.0, 1.03], 0.02, [(0, 0)]),
        ([0.0, 0.99, 1.0], [0.0, 1.001], 0.02, [(0, 0), (2, 1)]),
        ([0.0, 1.001], [0.0, 0.99, 1.0], 0.02, [(0, 0), (1, 2)]),
        ([0.0, 0.5, 1.0], [0.5], 0.0, [(1, 0)]),
        ([], [0.0], 0.1, []),
    ],
)
def test_instants_match_that_are_nearest_to_each_other_and_near_enough(
    a: list[float], b: list[float], early: float, pairs: list[tuple[int, int]]
) -> None:
    """Near enough is `early`, or a billionth of the time, or of a millisecond; either way around."""
    in_a, in_b = match_instants(np.array(a), np.array(b), early)
    assert list(zip(in_a.tolist(), in_b.tolist(), strict=True)) == pairs
