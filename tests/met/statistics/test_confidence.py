"""Exact bounds on shares and percentiles, against the binomial distribution and against published tables."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import beta, binom

from met.statistics.confidence import (
    cases_needed,
    lower_bound,
    most_misses,
    percentile_rank,
    upper_bound,
    verdict,
)

TABLE = {
    (0.95, 0.90): (45, 77, 105, 184, 306),
    (0.99, 0.95): (299, 473, 628, 1_049, 1_693),
    (0.9973, 0.90): (852, 1_440, 1_970, 3_433, 5_704),
    (0.9999, 0.90): (23_025, 38_896, 53_222, 92_745, 154_064),
    (0.999999, 0.90): (2_302_584, 3_889_719, 5_322_319, 9_274_672, 15_406_639),
}
"""Cases needed where 0, 1, 2, 5 and 10 of them miss the requirement; 852 is of NASA/TP-2010-216447."""


@pytest.mark.parametrize("wanted", TABLE)
def test_cases_needed_are_those_of_the_tables_and_no_fewer_do(wanted: tuple[float, float]) -> None:
    share, confidence = wanted
    found = tuple(cases_needed(share, confidence, missed) for missed in (0, 1, 2, 5, 10))
    assert found == TABLE[wanted]
    for missed, cases in zip((0, 1, 2, 5, 10), found, strict=True):
        assert verdict(cases, missed, share, confidence) == "demonstrated"
        assert verdict(cases - 1, missed, share, confidence) == "not shown"
        assert most_misses(cases, share, confidence) == missed
        assert binom.cdf(missed, cases, 1.0 - share) <= 1.0 - confidence < binom.cdf(missed, cases - 1, 1.0 - share)


@pytest.mark.slow
@pytest.mark.parametrize("cases", [1, 2, 17, 300])
@pytest.mark.parametrize("confidence", [0.5, 0.9, 0.99])
def test_bounds_are_those_of_clopper_and_pearson(cases: int, confidence: float) -> None:
    for missed in range(cases + 1):
        lower = beta.ppf(1.0 - confidence, cases - missed, missed + 1) if missed < cases else 0.0
        upper = beta.ppf(confidence, cases - missed + 1, missed) if missed else 1.0
        assert lower_bound(cases, missed, confidence) == pytest.approx(lower, rel=1e-12)
        assert upper_bound(cases, missed, confidence) == pytest.approx(upper, rel=1e-12)


@pytest.mark.parametrize("share", [0.9, 0.95, 0.99])
def test_a_wrong_verdict_is_as_rare_as_the_confidence_says(share: float) -> None:
    """By enumeration, at the limit: exactly so many meet it, so neither verdict is true by more than a hair."""
    cases, confidence = 400, 0.9
    chances = binom.pmf(np.arange(cases + 1), cases, 1.0 - share)
    said = np.array([verdict(cases, missed, share, confidence) for missed in range(cases + 1)])
    assert 0.05 < chances[said == "demonstrated"].sum() <= 0.1
    assert 0.05 < chances[said == "refuted"].sum() <= 0.1


@pytest.mark.parametrize(("share", "confidence", "cases"), [(0.95, 0.9, 45), (0.95, 0.9, 1000), (0.5, 0.99, 60)])
def test_an_order_statistic_bounds_a_percentile_as_often_as_it_says(
    share: float, confidence: float, cases: int
) -> None:
    """The value of rank k is at least the percentile if fewer than k of the cases are below it."""
    rank = percentile_rank(cases, share, confidence)
    assert binom.cdf(rank - 1, cases, share) >= confidence > binom.cdf(rank - 2, cases, share)


def test_one_case_may_be_enough() -> None:
    """One case without a miss demonstrates with confidence 0.9 that a bit less than a tenth of all cases meet it."""
    assert cases_needed(0.09, 0.9) == 1
    assert cases_needed(0.11, 0.9) == 2


def test_too_few_cases_bound_no_percentile() -> None:
    assert percentile_rank(44, 0.95, 0.9) == 0 and percentile_rank(45, 0.95, 0.9) == 45


@pytest.mark.parametrize("wrong", [(3, 4, 0.9), (3, -1, 0.9), (3, 1, 1.0), (3, 1, 0.0)])
def test_numbers_that_cannot_be_are_refused(wrong: tuple[int, int, float]) -> None:
    with pytest.raises(ValueError, match=r"cannot have missed|is not above 0"):
        lower_bound(*wrong)
    with pytest.raises(ValueError, match="cannot be demonstrated"):
        cases_needed(1.0, 0.9)
