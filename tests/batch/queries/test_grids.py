"""How the values of a parameter are spaced, and how many of them share the cells of a map."""

from __future__ import annotations

import numpy as np
import pytest

from batch.queries.grids import MOST_LEVELS, Scale, column_levels, is_log, levels, spacing

DENSE = (2 * np.geomspace(1e-4, 3.0, 300) / 2 * 180 / np.pi).tolist()
"""As numbers come from a deck, through SI and back."""


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([], "place"),
        ([5.0], "place"),
        ([1.0, 100.0], "linear"),  # two values rise in any way
        (np.linspace(-3.0, 4.0, 300).tolist(), "linear"),
        (np.linspace(0.1, 0.3, 7).round(3).tolist(), "linear"),
        ([0.33, 0.67, 1.0], "linear"),
        ([1.0, 3.0, 10.0], "log"),
        (np.geomspace(1.0, 1e6, 48).tolist(), "log"),
        (np.geomspace(1.0, 1e6, 49).tolist(), "log"),
        (np.geomspace(3e-9, 2e-7, 300).round(12).tolist(), "log"),
        (DENSE, "log"),
        ((-np.geomspace(1.0, 1e3, 60))[::-1].tolist(), "place"),  # no axis is logarithmic below zero
        ([0.0, *np.geomspace(0.01, 100.0, 60).tolist()], "place"),
        ([-1.0, *np.geomspace(0.01, 100.0, 60).tolist()], "place"),
        ([1.0, 2.0, 5.0, 10.0, 50.0], "place"),
    ],
)
def test_values_rise_by_steps_or_by_factors_or_neither(values: list[float], expected: Scale) -> None:
    assert spacing(np.array(values)) == expected


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1.0, 1000.0], False),
        ([1.0, 2.0, 500.0], True),  # so many times the smallest that the small ones would be one on another
        ([1.0, 2.0, 50.0], False),
        ([0.0, 1.0, 500.0], False),
        ([-500.0, 1.0, 500.0], False),
        (np.linspace(1.0, 1000.0, 9).tolist(), False),
        (DENSE, True),
    ],
)
def test_points_lie_on_a_logarithmic_axis_where_small_values_need_it(values: list[float], expected: bool) -> None:
    assert is_log(np.array(values)) is expected


@pytest.mark.parametrize("count", [49, 50, 95, 96, 97, 300, 1000])
@pytest.mark.parametrize("space", [np.linspace, np.geomspace])
def test_many_values_of_a_grid_share_cells_of_which_none_is_empty(space: type[np.linspace], count: int) -> None:
    values = np.repeat(space(0.3, 70.0, count), 2)
    found = column_levels(values)
    assert len(found.texts) == MOST_LEVELS and found.stretches
    assert np.bincount(found.places, minlength=MOST_LEVELS).min() > 0
    assert found.scale == ("log" if space is np.geomspace else "linear")
    assert (np.diff(found.values) > 0).all() and len(found.values) == MOST_LEVELS + 1
    inside = (found.values[found.places] < values) & (values < found.values[found.places + 1])
    assert inside.all()


def test_irregular_values_of_a_grid_share_cells_of_one_width() -> None:
    values = np.repeat([*np.linspace(0.0, 1.0, 40), *np.linspace(100.0, 101.0, 40)], 3)
    found = column_levels(values)
    assert found.scale == "place" and np.bincount(found.places, minlength=MOST_LEVELS).min() > 0


def test_samples_share_stretches_that_are_as_wide_by_factors_where_they_span_many() -> None:
    rng = np.random.default_rng(1)
    even, wide = (
        column_levels(rng.uniform(5.0, 9.0, 5000), most=300),
        column_levels(10 ** rng.uniform(-3.0, 2.0, 5000), most=300),
    )
    assert (even.scale, wide.scale) == ("linear", "log")
    assert len(even.texts) == len(wide.texts) == MOST_LEVELS
    np.testing.assert_allclose(np.diff(even.values), np.diff(even.values)[0])
    np.testing.assert_allclose(np.diff(np.log(wide.values)), np.diff(np.log(wide.values))[0])


def test_what_is_no_number_has_no_level() -> None:
    found = column_levels(np.array([np.nan, 1.0, np.inf, 2.0, 1.0]))
    assert found.places.tolist() == [-1, 0, -1, 1, 0] and levels(np.array([np.nan])).size == 0
