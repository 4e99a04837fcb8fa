"""Exact sums, moments and order statistics of values that come in blocks, against fractions and sorted arrays."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from met.statistics.moments import ExactSum, Furthest, Moments

SIZES = (1, 7, 100, 1000)


def values_of(seed: int, count: int = 1000) -> np.ndarray:
    """Values of very unlike sizes, so that sums of doubles lose digits."""
    source = np.random.default_rng(seed)
    return source.normal(size=count) * 10.0 ** source.integers(-12, 12, count)


@pytest.mark.parametrize("seed", range(5))
def test_a_sum_is_that_of_fractions_rounded_for_each_block_and_once_more(seed: int) -> None:
    values, exact = values_of(seed), ExactSum()
    blocks = np.split(values, [100, 101, 500])
    for block in blocks:
        exact.add(block)
    wanted = sum(Fraction(float(sum(map(Fraction, block.tolist())))) for block in blocks)
    assert exact.value == float(wanted)


@pytest.mark.parametrize("seed", range(5))
def test_a_sum_does_not_depend_on_the_order_of_blocks(seed: int) -> None:
    blocks = np.split(values_of(seed), 20)
    sums = []
    for order in (range(20), reversed(range(20))):
        exact = ExactSum()
        for at in order:
            exact.add(blocks[at])
        sums.append(exact.value)
    assert sums[0] == sums[1]


def test_a_sum_that_no_double_holds_is_no_number() -> None:
    exact = ExactSum()
    exact.add(np.full(3, 1.7e308))
    assert math.isnan(exact.value)
    exact = ExactSum()
    for _ in range(3):
        exact.add(np.array([1.7e308]))
    assert math.isnan(exact.value)


@pytest.mark.parametrize("offset", [0.0, 1e9])
def test_moments_are_those_of_fractions(offset: float) -> None:
    values = np.random.default_rng(3).normal(size=5000) + offset
    values[[5, 77]] = math.inf, math.nan
    found = Moments()
    for block in np.split(values, [64, 128, 4000]):
        found.add(block)
    exact = [Fraction(x) for x in values[np.isfinite(values)].tolist()]
    mean = sum(exact) / len(exact)
    variance = sum((x - mean) ** 2 for x in exact) / (len(exact) - 1)
    assert found.count == 4998
    assert found.mean == pytest.approx(float(mean), rel=1e-15)
    # the differences from the first value are rounded to its last place, 1.2e-7 at 1e9
    assert found.variance == pytest.approx(float(variance), rel=1e-14 if not offset else 1e-9)


def test_moments_of_too_few_values_are_no_numbers() -> None:
    found = Moments()
    found.add(np.array([math.nan, math.inf]))
    assert found.count == 0 and math.isnan(found.mean) and math.isnan(found.variance)
    found.add(np.array([2.5]))
    assert found.mean == 2.5 and math.isnan(found.variance)


@pytest.mark.parametrize("most", [1, 3, 250, 1000])
@pytest.mark.parametrize("size", SIZES)
def test_the_least_of_the_furthest_is_an_order_statistic(most: int, size: int) -> None:
    values = np.round(np.random.default_rng(most).normal(size=20_000), 2)  # with ties
    found = Furthest(most)
    for first in range(0, len(values), size):
        found.add(values[first : first + size])
    assert found.least == np.sort(values)[-most]


def test_too_few_values_or_infinite_ones_bound_nothing() -> None:
    few, endless, none = Furthest(5), Furthest(2), Furthest(0)
    few.add(np.arange(4.0))
    endless.add(np.array([1.0, math.inf, math.inf]))
    none.add(np.arange(4.0))
    assert all(math.isnan(each.least) for each in (few, endless, none))
