"""How far colours reach: a few values that stray leave the others their colours, and are counted."""

from __future__ import annotations

import numpy as np
import pytest

from batch.queries.colours import Reach, reach

RNG = np.random.default_rng(3)
BULK = np.linspace(0.0, 50.0, 700)


def of(values: object, **options: object) -> Reach:
    found = reach(np.asarray(values, float), **options)  # type: ignore[arg-type]
    assert found is not None
    return found


@pytest.mark.parametrize(
    "values",
    [
        BULK,
        [1.0, 1e6],
        [3.0, 3.0, 3.0],
        np.repeat([1.0, 5.5], [70, 30]),  # two states of a thing
        np.concatenate([np.zeros(800), np.linspace(0.0, 20.0, 200)]),  # an overshoot that most cases do not have
        np.concatenate([10.0 ** np.linspace(-12.0, -3.0, 960), np.linspace(0.0, 20.0, 40)]),
        np.append(0.03 + 1e-15 * np.arange(30), [0.035, 0.035]),  # roundings are no range
        RNG.normal(size=3000),
        RNG.exponential(size=3000),
    ],
)
def test_colours_reach_over_all_values_where_these_are_told_apart(values: object) -> None:
    found = of(values)
    assert (found.below, found.above, found.log) == (0, 0, False)
    assert (found.low, found.high) == (found.least, found.most)


@pytest.mark.parametrize(
    ("stray", "below", "above"),
    [
        ([1e9], 0, 1),
        ([-1e9, 1e9, 1e300], 1, 2),
        (np.linspace(1e6, 2e6, 175), 0, 175),
        (10.0 ** np.linspace(3.0, 12.0, 300), 0, 300),
        (-(10.0 ** np.linspace(3.0, 12.0, 300)), 300, 0),
        ([np.inf, -np.inf, np.nan, 1e9], 0, 1),
    ],
)
def test_values_that_stray_far_lie_beyond_the_colours_and_are_counted(stray: object, below: int, above: int) -> None:
    found = of(np.concatenate([BULK, stray]))
    assert (found.low, found.high, found.below, found.above) == (0.0, 50.0, below, above)


def test_a_single_value_strays_among_a_few_as_well() -> None:
    assert of([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 1e6]) == Reach(1.0, 8.0, False, 0, 1, 1.0, 1e6)


def test_colours_are_logarithmic_where_most_values_stray() -> None:
    found = of(np.concatenate([BULK[1:], 10.0 ** np.linspace(3.0, 20.0, 1000)]))
    assert found.log and (found.below, found.above) == (0, 0)


def test_colours_of_changes_reach_as_far_below_zero_as_above_it() -> None:
    changes = np.append(np.linspace(-1.0, 3.0, 100), -1e7)
    assert of(changes, parting=True) == Reach(-3.0, 3.0, False, 1, 0, -1e7, 3.0)
    assert of(np.zeros(9), parting=True).high == 1.0


def test_a_limit_that_is_near_is_within_the_colours() -> None:
    values = np.append(BULK, 1e9)
    assert of(values, limits=[60.0]).high == 60.0
    assert of(values, limits=[1e8]).high == 50.0
    assert of(BULK, limits=[60.0]).high == 50.0  # no value comes near it


def test_what_lies_beyond_is_told() -> None:
    assert of(np.append(BULK, [-1e7, 1e9, 2e9])).beyond_texts == ("1 below, down to -1e+07", "2 above, up to 2e+09")
    assert of(BULK).beyond_texts == ("", "")


def test_where_there_is_no_number_there_are_no_colours() -> None:
    assert reach(np.array([np.nan, np.inf])) is None
    assert reach(np.zeros(0)) is None


def test_a_million_values_take_no_time() -> None:
    values = np.append(RNG.uniform(size=1_000_000), 1e9)
    found = of(values)
    assert found.above == 1 and found.high < 1.0
