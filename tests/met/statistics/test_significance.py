"""Probabilities by chance, against the enumeration of all outcomes."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from met.statistics.significance import holm, sign_test


@pytest.mark.parametrize("pairs", range(1, 13))
def test_the_sign_test_is_the_enumeration_of_all_signs(pairs: int) -> None:
    rises = np.array([sum(signs) for signs in product((0, 1), repeat=pairs)])
    for higher in range(pairs + 1):
        as_one_sided = np.abs(2 * rises - pairs) >= abs(2 * higher - pairs)
        assert sign_test(higher, pairs - higher) == pytest.approx(as_one_sided.mean(), rel=1e-13)


def test_mcnemar_of_three_better_and_none_worse_of_28_cases_shows_nothing() -> None:
    assert sign_test(3, 0) == 0.25
    assert sign_test(0, 0) == 1.0


def test_many_pairs_are_exact() -> None:
    from scipy.stats import binomtest

    for higher, lower in ((400, 600), (10, 990), (499_000, 501_000)):
        assert sign_test(higher, lower) == pytest.approx(binomtest(higher, higher + lower).pvalue, rel=1e-9)


def test_pairs_are_counted_from_nothing_up() -> None:
    with pytest.raises(ValueError, match="-1"):
        sign_test(-1, 3)


def test_holm_keeps_false_alarms_of_a_family_at_the_level() -> None:
    # independent tests that are exact: each chance is uniform on (0, 1) where nothing differs
    drawn = np.random.default_rng(7).uniform(size=(20_000, 5))
    alarms = np.mean([min(holm(row.tolist())) < 0.05 for row in drawn])
    assert abs(alarms - (1.0 - 0.99**5)) < 3.0 * np.sqrt(0.05 / 20_000)
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
