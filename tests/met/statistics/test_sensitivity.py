"""Shares of variance against functions whose indices are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from met.statistics.sensitivity import FEWEST, Shares, dependent, shares

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


def test_intervals_hold_what_is_true_as_often_as_they_say() -> None:
    held = []
    for seed in range(40):
        for share, (first, _) in zip(ishigami(4_000, 100 + seed).inputs, ISHIGAMI, strict=True):
            held.append(abs(share.first - first) <= share.first_by)
    # 95 % is said; 120 draws have a standard error of 2 %
    assert np.mean(held) > 0.89


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
        assert -share.total_by - 1e-3 <= total - share.total <= share.total_by + found.rest + 1e-3


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
