"""Shares of variance against functions whose indices are known in closed form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from met.statistics.sensitivity import FEWEST, Shares, dependent, shares
from tests.met.statistics.interval_coverage import corner, product, step

ISHIGAMI = ((0.3139, 0.5576), (0.4424, 0.4424), (0.0, 0.2437))
"""First-order and total indices with a = 7 and b = 0.1: T. Ishigami and T. Homma, 1990."""


def ishigami(cases: int, seed: int) -> Shares:
    x = np.random.default_rng(seed).uniform(-np.pi, np.pi, (3, cases))
    found = shares(list(x), np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]))
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(5))
def test_ishigami_from_any_10_000_cases(seed: int) -> None:
    found = ishigami(10_000, seed)
    for share, (first, total) in zip(found.inputs, ISHIGAMI, strict=True):
        assert share.total is not None
        assert share.first == pytest.approx(first, abs=0.02)
        assert share.total == pytest.approx(total, abs=0.035)
    assert found.rest is not None and found.rest < 0.05


def indices(*parts: tuple[tuple[int, ...], float]) -> list[tuple[float, float]]:
    """First-order and total indices of three inputs from the variances that sets of them explain together."""
    whole = sum(variance for _, variance in parts)
    return [
        (
            sum(variance for inputs, variance in parts if inputs == (place,)) / whole,
            sum(variance for inputs, variance in parts if place in inputs) / whole,
        )
        for place in range(3)
    ]


P, Q, LINEAR = 0.63 * 0.37, 0.39 * 0.61, 1.0 / 12.0
KNOWN = {
    corner: indices(((0,), P * 0.39**2), ((1,), Q * 0.63**2), ((0, 1), P * Q), ((2,), 0.01 * LINEAR)),
    product: indices(((0, 1), LINEAR**2), ((2,), 0.01 * LINEAR)),
    step: indices(((0,), 0.21), ((1,), 0.04 * LINEAR)),
}


@pytest.mark.slow
@pytest.mark.parametrize("cases", [300, 2_000])
@pytest.mark.parametrize("function", [corner, product, step])
def test_intervals_hold_what_is_true_as_often_as_they_say(
    function: Callable[[np.ndarray], np.ndarray], cases: int
) -> None:
    held = np.zeros((60, 3, 2), bool)
    for draw in range(60):
        x = np.random.default_rng(100 + draw).uniform(size=(3, cases))
        found = shares(list(x), function(x))
        assert found is not None
        for place, (share, (first, total)) in enumerate(zip(found.inputs, KNOWN[function], strict=True)):
            held[draw, place] = abs(share.first - first) <= share.first_by, share.total_low <= total <= share.total_high
    # 95 % is said; 60 draws have a standard error of 2.8 %
    assert (held.mean(axis=0) > 0.89).all(), held.mean(axis=0)


def test_intervals_of_ishigami_hold_what_is_true() -> None:
    held = []
    for seed in range(20):
        for share, (first, total) in zip(ishigami(4_000, 100 + seed).inputs, ISHIGAMI, strict=True):
            held += [abs(share.first - first) <= share.first_by, share.total_low <= total <= share.total_high]
    assert np.mean(held) > 0.93


def test_sobols_g_within_its_intervals_and_the_rest() -> None:
    a = np.array([0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0])
    alone = 1.0 / (3.0 * (1.0 + a) ** 2)
    whole = np.prod(1.0 + alone) - 1.0
    x = np.random.default_rng(3).uniform(size=(8, 10_000))
    found = shares(list(x), np.prod((np.abs(4.0 * x.T - 2.0) + a) / (1.0 + a), axis=1))
    assert found is not None and found.rest is not None
    for share, first, total in zip(
        found.inputs, alone / whole, alone * np.prod(1.0 + alone) / (1.0 + alone) / whole, strict=True
    ):
        assert share.total is not None
        assert abs(share.first - first) <= share.first_by + 1e-3
        assert share.total_low - 1e-3 <= total <= share.total_high + 1e-3


def test_a_product_of_lists_is_exact() -> None:
    a, b = (each.ravel() for each in np.meshgrid(np.arange(20.0), np.arange(30.0)))
    found = shares([a, b], 3.0 * a + b)
    assert found is not None
    first = 9.0 * np.var(np.arange(20.0)) / (9.0 * np.var(np.arange(20.0)) + np.var(np.arange(30.0)))
    assert found.inputs[0].first == pytest.approx(first, abs=0.01)
    assert found.inputs[0].first + found.inputs[1].first == pytest.approx(1.0, abs=0.01)
    assert (found.inputs[0].low, found.inputs[0].high) == pytest.approx((14.5, 57.0 + 14.5))


def test_noise_is_of_no_input() -> None:
    rng = np.random.default_rng(5)
    x = rng.uniform(size=(6, 5_000))
    found = shares(list(x), rng.normal(size=5_000))
    assert found is not None and found.rest is not None
    assert found.rest > 0.9
    assert all(share.first <= share.first_by + 0.005 for share in found.inputs)


def test_what_does_not_vary_has_no_shares_and_few_cases_are_refused() -> None:
    assert shares([np.arange(100.0)], np.ones(100)) is None
    assert shares([np.arange(100.0)], np.pi + 1e-17 * np.arange(100.0)) is None, "that is rounding"
    assert shares([np.arange(100.0)], 1e-17 * np.arange(100.0)) is not None
    with pytest.raises(ValueError, match=str(FEWEST)):
        shares([np.arange(9.0)], np.arange(9.0))


def test_ranks_and_dependence() -> None:
    rng = np.random.default_rng(6)
    a, b = rng.uniform(size=(2, 3_000))
    found = shares([a, b], np.exp(5.0 * a))
    assert found is not None
    assert found.inputs[0].rank == pytest.approx(1.0) and abs(found.inputs[1].rank) < 0.08
    assert dependent([a, b]) == []
    [(first, second, size)] = dependent([a, b, a + 0.3 * b])[:1]
    assert (first, second) == (0, 2) and size > 0.9


def test_what_depends_without_rising_or_falling_is_seen_and_what_is_independent_seldom() -> None:
    rng = np.random.default_rng(7)
    a, b = rng.uniform(-1.0, 1.0, (2, 2_000))
    inside = a**2 + b**2 < 1.0
    assert [pair[:2] for pair in dependent([a[inside], b[inside]])] == [(0, 1)]
    assert [pair[:2] for pair in dependent([a, b, a**2])] == [(0, 2)]
    assert dependent([each.ravel() for each in np.meshgrid(np.arange(7.0), np.arange(50.0), np.arange(90.0))]) == []
    seen = sum(bool(dependent(list(rng.uniform(size=(3, 100))))) for _ in range(200))
    assert seen <= 2, "one in a thousand is said"


def test_ranges_stay_among_the_shares_that_there_are() -> None:
    a, b = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 1.0, 11), np.linspace(0.0, 1.0, 11)))
    rows = a + b <= 1.01
    found = shares([a[rows], b[rows]], 3.0 * a[rows] + b[rows])
    assert found is not None
    assert all(0.0 <= share.total_low <= share.total_high <= 1.0 for share in found.inputs)
    heavy = shares(list(np.random.default_rng(8).uniform(size=(2, 64))), np.exp(np.linspace(0.0, 200.0, 64)))
    assert heavy is not None and all(share.first_by <= 1.0 for share in heavy.inputs)


@pytest.mark.slow
def test_the_means_at_the_ends_of_what_has_no_effect_are_told_apart_as_seldom_as_they_say() -> None:
    """In 5 % of samples, of any cases and of those of a design, and never of what has an effect."""
    random, apart, seen, count = np.random.default_rng(4), 0, 0, 200
    for _ in range(count):
        a, idle = random.uniform(0.0, 1.0, (2, 300))
        found = shares([a, idle], a + random.normal(0.0, 0.2, 300))
        assert found is not None
        apart += abs(found.inputs[1].high - found.inputs[1].low) > found.inputs[1].ends_by
        seen += abs(found.inputs[0].high - found.inputs[0].low) > found.inputs[0].ends_by
    assert 0.01 * count <= apart <= 0.1 * count and seen == count


def test_means_that_differ_by_rounding_are_equal() -> None:
    a, b = (each.ravel().astype(float) for each in np.meshgrid(np.arange(-4, 5), np.arange(9)))
    found = shares([a, b], np.sin(a) * 0.1 + 1e-17 * b)
    assert found is not None and found.inputs[1].low == found.inputs[1].high == 0.0
    assert found.inputs[0].low > 0.05 and found.inputs[0].high < -0.03
