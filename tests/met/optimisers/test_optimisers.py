"""What every optimiser keeps: its points, the unit cube, the bits of its choices; and what it finds."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from met import optimisers
from met.optimisers.optimiser import Optimiser
from tests.met.optimisers import landscapes
from tests.met.optimisers.landscapes import least, least_of_random

EVERY = [optimisers.hardest, optimisers.tuner]


def asked(optimiser: Optimiser, landscape: landscapes.Landscape) -> list[np.ndarray]:
    out = []
    while len(points := optimiser.ask()):
        out.append(points.copy())
        optimiser.tell(landscape(points))
    return out


@pytest.mark.slow
@pytest.mark.parametrize("make", EVERY)
@pytest.mark.parametrize("dimension", [1, 2, 3, 16, 40])
@pytest.mark.parametrize("at_most", [0, 1, 7, 8, 100, 1001])
def test_it_asks_for_exactly_its_points_all_in_the_unit_cube(make, dimension, at_most):
    optimiser = make(dimension, 3, at_most)
    generations = asked(optimiser, landscapes.corner)
    assert sum(map(len, generations)) == at_most
    for points in generations:
        assert points.shape[1] == dimension and (points >= 0.0).all() and (points <= 1.0).all()
    assert optimiser.ask().shape == (0, dimension)


@pytest.mark.parametrize("make", EVERY)
def test_the_same_values_told_make_it_ask_for_the_same_points(make):
    once = asked(make(5, 7, 800), landscapes.plateau)
    again = asked(make(5, 7, 800), landscapes.plateau)
    other = asked(make(5, 8, 800), landscapes.plateau)
    assert [x.tobytes() for x in once] == [x.tobytes() for x in again]
    assert np.concatenate(once).tobytes() != np.concatenate(other).tobytes()


@pytest.mark.parametrize(
    ("make", "digest"),
    [(optimisers.hardest, "52abed6c97b59f22"), (optimisers.tuner, "21d2ab637e4f09bf")],
)
def test_its_points_are_the_same_on_every_machine(make, digest):
    """The values told are exact too: differences, squares and sums in order, of dyadic numbers."""

    def exact(points: np.ndarray) -> np.ndarray:
        return np.add.accumulate((np.floor(points * 1024.0) / 1024.0 - 0.25) ** 2, axis=1)[:, -1]

    points = np.concatenate(asked(make(6, 1, 2000), exact))
    assert hashlib.sha256(points.tobytes()).hexdigest()[:16] == digest


@pytest.mark.parametrize("make", EVERY)
def test_only_the_order_of_values_matters(make):
    """So penalties and scales do no harm: of the values, of their cubes, and of numbers a million times larger."""
    once = asked(make(4, 2, 600), landscapes.ackley)
    cubed = asked(make(4, 2, 600), lambda points: 1e6 * landscapes.ackley(points) ** 3)
    assert [x.tobytes() for x in once] == [x.tobytes() for x in cubed]


@pytest.mark.parametrize("make", EVERY)
def test_where_all_is_equally_good_it_goes_on(make):
    generations = asked(make(3, 1, 500), lambda points: np.full(len(points), np.inf))
    points = np.concatenate(generations)
    assert len(points) == 500 and np.isfinite(points).all()
    assert (np.histogram(points[:, 0], bins=5, range=(0.0, 1.0))[0] > 0).all()


@pytest.mark.parametrize("make", EVERY)
def test_where_all_but_a_few_are_equally_good_its_points_stay_numbers(make):
    """As of a settling time that is a whole number of samples."""
    worse = asked(make(3, 1, 1000), lambda points: np.where(points[:, 0] > 0.9, 1.0, 0.0))
    better = asked(make(3, 1, 1000), lambda points: np.where(points[:, 0] > 0.9, -1.0, 0.0))
    assert np.isfinite(np.concatenate(worse + better)).all()
    assert (np.concatenate(better[-3:])[:, 0] > 0.9).mean() > 0.25  # of random points 0.1


@pytest.mark.parametrize("make", EVERY)
def test_failures_all_around_do_not_hide_the_minimum(make):
    found = least(make(6, 1, 2000), landscapes.plateau)
    assert found < 1e-2 * least_of_random(6, 1, 2000, landscapes.plateau)


def test_a_search_ends_with_the_first_case_that_nothing_can_hurt_more():
    search = optimisers.hardest(2, 1, 2000)
    points = search.ask()
    values = landscapes.sphere(points)
    values[3] = -np.inf
    search.tell(values)
    assert len(search.ask()) == 0


def test_a_tuning_goes_on_where_a_candidate_is_infinitely_good():
    tuning = optimisers.tuner(2, 1, 800)
    values = landscapes.sphere(tuning.ask())
    values[:2] = -np.inf, np.inf
    tuning.tell(values)
    assert sum(len(points) for points in asked(tuning, landscapes.sphere)) == 800 - len(values)


def test_a_generation_keeps_lanes_and_threads_busy():
    sizes = {at_most: len(optimisers.hardest(5, 1, at_most).ask()) for at_most in (100, 2000, 4000, 100_000)}
    assert sizes == {100: 8, 2000: 56, 4000: 120, 100_000: 256}
    assert len(optimisers.tuner(8, 1, 3200).ask()) == 32


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 5, 16])
def test_a_search_reaches_the_corner(dimension):
    """2,000 points; the best of 100,000 random ones in 16 dimensions is 3.2 from it."""
    bound = {2: 1e-12, 5: 1e-3, 16: 1.0}[dimension]
    assert max(least(optimisers.hardest(dimension, seed, 2000), landscapes.corner) for seed in range(3)) < bound


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [1, 2, 5, 16])
def test_a_search_finds_a_resonance_that_is_one_percent_wide(dimension):
    for seed in range(3):
        assert least(optimisers.hardest(dimension, seed, 2000), landscapes.resonance) < -95.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("landscape", "bound"),
    [(landscapes.sphere, 1e-9), (landscapes.ellipsoid, 1e-4), (landscapes.ackley, 1e-3), (landscapes.corner, 1e-3)],
)
def test_a_tuning_of_eight_finds_the_minimum(landscape, bound):
    assert max(least(optimisers.tuner(8, seed, 3200), landscape) for seed in range(3)) < bound


def test_a_tuning_that_has_converged_starts_again_elsewhere_with_twice_the_population():
    generations = asked(optimisers.tuner(2, 1, 6400), landscapes.sphere)
    sizes = [len(points) for points in generations]
    again = sizes.index(128)
    assert set(sizes[:again]) == {64} and np.ptp(generations[again - 1], axis=0).max() < 1e-5
    assert np.ptp(generations[again], axis=0).min() > 0.3


def test_noise_does_not_lead_astray():
    def noisy(points: np.ndarray) -> np.ndarray:
        noise = np.random.default_rng(points.tobytes()[0]).normal(size=len(points))
        return landscapes.sphere(points) + 0.1 * noise

    tuning = optimisers.tuner(4, 1, 3200)
    last = asked(tuning, noisy)[60]
    assert landscapes.sphere(last).mean() < 0.3
