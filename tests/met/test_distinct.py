"""The different values of an array, against a set's."""

from __future__ import annotations

import numpy as np
import pytest

from met.distinct import distinct

NAN, INF = np.nan, np.inf


@pytest.mark.parametrize(("values", "expected"), [
    ([], []), ([3, 1, 3, 2, 1], [1, 2, 3]), ([[2.0, 1.0], [1.0, 2.0]], [1.0, 2.0]),
    ([NAN, 1.0, NAN, -INF, INF, INF], [-INF, 1.0, INF, NAN]), ([NAN, NAN], [NAN]), (["b", "a", "b"], ["a", "b"]),
    ([True, False, True], [False, True]), ([5], [5]),
])  # fmt: skip
def test_rising_each_once(values: list[object], expected: list[object]) -> None:
    np.testing.assert_array_equal(distinct(np.array(values)), np.array(expected))


def test_as_a_set_has_them() -> None:
    values = np.random.default_rng(5).integers(-40, 40, 5000)
    assert distinct(values).tolist() == sorted(set(values.tolist()))
