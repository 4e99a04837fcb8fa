"""How often a search finds what is planted, beside as many random points: figures of 20 seeds."""

from __future__ import annotations

import numpy as np
import pytest

from met import optimisers
from tests.met.optimisers import landscapes
from tests.met.optimisers.landscapes import Landscape, least, least_of_random

pytestmark = pytest.mark.slow

POINTS, SEEDS = 2000, 20


def found(landscape: Landscape, dimension: int, below: float) -> tuple[int, int]:
    """Of 20 seeds, in how many a search and as many random points come below a value."""
    searched = sum(least(optimisers.hardest(dimension, seed, POINTS), landscape) < below for seed in range(SEEDS))
    drawn = sum(least_of_random(dimension, seed, POINTS, landscape) < below for seed in range(SEEDS))
    return searched, drawn


@pytest.mark.release
@pytest.mark.parametrize("dimension", [1, 2, 5, 16])
def test_a_resonance_is_found_in_every_seed_to_a_tenth_of_its_height(dimension: int) -> None:
    searched, drawn = found(landscapes.resonance, dimension, -90.0)
    assert searched == 20
    if dimension == 16:
        assert drawn <= 2


@pytest.mark.release
@pytest.mark.parametrize("dimension", [2, 5, 16])
def test_a_resonance_under_a_trend_of_the_others_is_found_in_every_seed(dimension: int) -> None:
    """The least is about -100 less what the trend has in the corner that it falls to."""
    trend = np.random.default_rng(dimension).normal(size=dimension)[1:]
    lowest = -100.0 - 30.0 * np.maximum(trend, 0.0).sum() / np.abs(trend).sum()
    searched, drawn = found(landscapes.resonance_and_trend, dimension, 0.95 * lowest)
    assert searched == 20 and drawn < searched


def test_a_peak_in_two_dimensions_without_a_slope_to_it_is_found_about_as_often_as_by_chance() -> None:
    """Nothing leads to it: what a search can do is not to be worse than random points."""
    searched, drawn = found(landscapes.peak_beside_a_hill, 2, -0.75)
    assert searched >= drawn - 5


@pytest.mark.release
@pytest.mark.parametrize("dimension", [5, 16])
@pytest.mark.parametrize(
    "landscape",
    [
        landscapes.sphere,
        landscapes.ellipsoid,
        landscapes.rosenbrock,
        landscapes.rastrigin,
        landscapes.ackley,
        landscapes.corner,
        landscapes.plateau,
    ],
)
def test_the_best_of_a_hundred_thousand_random_points_is_passed_in_nine_seeds_of_ten(
    landscape: Landscape, dimension: int
) -> None:
    """Of a valley a hundred times as long as wide, turned out of the axes, in seven of ten in five dimensions: with the
    share of its points that polishing has, a search is not at its bottom by then."""
    random = least_of_random(dimension, 1, 100_000, landscape)
    passed = sum(least(optimisers.hardest(dimension, seed, POINTS), landscape) < random for seed in range(10))
    assert passed >= (7 if (landscape, dimension) == (landscapes.ellipsoid, 5) else 9)
