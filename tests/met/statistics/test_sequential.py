"""The test that may be looked at after every case: a martingale at the limit, wrong as seldom as it says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from met.statistics import confidence as fixed
from met.statistics.sequential import (
    cases_needed,
    decided,
    evidence_against,
    evidence_for,
    limits,
    lower_bound,
    percentile_rank,
    upper_bound,
)
from tests.met.statistics.stopping import CONFIDENCE, decide, false_shares, fixed_limits, misses

SHARES = (0.5, 0.95, 0.9973)


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("true", [0.0, 0.02, -0.02])
def test_the_evidence_of_what_is_not_so_does_not_grow_on_the_average(share: float, true: float) -> None:
    """At the limit itself it is a martingale, from 1 on; where the requirement is missed further, it falls."""
    meets = min(share + true, 1.0)
    for evidence, not_so in ((evidence_for, true <= 0.0), (evidence_against, true >= 0.0)):
        for cases in (0, 1, 7, 90):
            missed = np.arange(cases + 1)
            now = evidence(np.full(cases + 1, cases), missed, share)
            met, lost = (evidence(np.full(cases + 1, cases + 1), missed + more, share) - now for more in (0, 1))
            average = np.exp(met) * meets + np.exp(lost) * (1.0 - meets)
            if true == 0.0:
                assert average == pytest.approx(1.0, abs=1e-9)
            elif not_so:
                assert (average <= 1.0 + 1e-9).all()
            if not cases:
                assert now == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("share", [0.9, 0.99])
def test_a_false_verdict_at_the_limit_is_as_rare_as_it_says_by_counting_all_ways(share: float) -> None:
    """The chance of each number of misses after each case, less what has been decided, exactly: nothing is drawn."""
    most = 1_500
    found = limits(share, CONFIDENCE, most)
    chances, said = np.zeros(most + 2), {1: 0.0, -1: 0.0}
    chances[0] = 1.0
    for cases in range(1, most + 1):
        chances[1:] = chances[1:] * share + chances[:-1] * (1.0 - share)
        chances[0] *= share
        verdicts = found.verdicts(np.full(most + 2, cases), np.arange(most + 2))
        for verdict in said:
            said[verdict] += chances[verdicts == verdict].sum()
        chances[verdicts != 0] = 0.0
    assert 0.02 < said[1] <= 1.0 - CONFIDENCE
    assert 0.02 < said[-1] <= 1.0 - CONFIDENCE


@pytest.mark.parametrize(("share", "chance"), [(0.95, 0.02), (0.95, 0.1), (0.5, 0.45), (0.999, 0.0), (0.9, 1.0)])
@pytest.mark.parametrize("cases", [1, 40, 2_500])
def test_limits_are_those_of_the_evidence_itself(share: float, chance: float, cases: int) -> None:
    missed = np.random.default_rng(cases).uniform(size=cases) < chance
    count, so_far, wanted = np.arange(1, cases + 1), np.cumsum(missed), -math.log1p(-CONFIDENCE)
    shown = (evidence_for(count, so_far, share) >= wanted).astype(int) - (
        evidence_against(count, so_far, share) >= wanted
    )
    assert (limits(share, CONFIDENCE, cases).verdicts(count, so_far) == shown).all()
    first = int((shown != 0).argmax())
    words = {1: "demonstrated", -1: "refuted"}
    told = (first + 1, words[shown[first]]) if shown.any() else (cases, "not shown")
    assert decided(missed, share, CONFIDENCE) == told


def test_a_longer_campaign_decides_a_shorter_ones_cases_alike() -> None:
    missed = np.random.default_rng(4).uniform(size=3_000) < 0.01
    whole = decided(missed, 0.95, 0.9)
    assert whole[1] == "demonstrated"
    assert decided(missed[: whole[0]], 0.95, 0.9) == whole
    assert decided(missed[: whole[0] - 1], 0.95, 0.9) == (whole[0] - 1, "not shown")


@pytest.mark.parametrize("share", SHARES)
def test_cases_needed_are_the_fewest_and_more_than_a_fixed_number_takes(share: float) -> None:
    for missed in (0, 1, 5):
        found = cases_needed(share, 0.9, missed)
        wanted = math.log(10.0)
        assert evidence_for(np.array(found), np.array(missed), share) >= wanted
        assert evidence_for(np.array(found - 1), np.array(missed), share) < wanted
        assert found >= fixed.cases_needed(share, 0.9, missed)


@pytest.mark.parametrize(
    ("cases", "missed"), [(1, 0), (1, 1), (50, 0), (50, 2), (3_000, 7), (3_000, 3_000), (10**6, 3)]
)
def test_bounds_lie_where_the_test_of_a_share_decides_and_outside_of_the_exact_ones(cases: int, missed: int) -> None:
    low, high = lower_bound(cases, missed, 0.9), upper_bound(cases, missed, 0.9)
    assert low <= fixed.lower_bound(cases, missed, 0.9) and high >= fixed.upper_bound(cases, missed, 0.9)
    n, k, wanted = np.array(cases), np.array(missed), math.log(10.0)
    for share in (low - 1e-9, low + 1e-9):
        assert not 0.0 < share < 1.0 or (evidence_for(n, k, share) >= wanted) == (share < low)
    for share in (high - 1e-9, high + 1e-9):
        assert not 0.0 < share < 1.0 or (evidence_against(n, k, share) >= wanted) == (share > high)


def test_an_order_statistic_bounds_the_percentile_that_it_would_demonstrate() -> None:
    assert percentile_rank(cases_needed(0.95, 0.9) - 1, 0.95, 0.9) == 0
    for missed in (0, 1, 4):
        cases = cases_needed(0.95, 0.9, missed)
        assert percentile_rank(cases, 0.95, 0.9) == cases - missed
        assert percentile_rank(cases - 1, 0.95, 0.9) == max(0, cases - 1 - (missed - 1)) * (missed > 0)


def test_drawing_the_gaps_between_misses_is_drawing_the_cases() -> None:
    at_most = 600
    missed = misses(np.random.default_rng(7), 50, 0.05, at_most)
    for made in (fixed_limits(0.95, 0.9, at_most), limits(0.95, 0.9, at_most)):
        found = decide(made, missed, at_most)
        for row, cases, verdict in zip(missed, found.cases, found.verdict, strict=True):
            single = np.zeros(at_most, int)
            single[row[row <= at_most] - 1] = 1
            said = made.verdicts(np.arange(1, at_most + 1), np.cumsum(single))
            first = int((said != 0).argmax()) if said.any() else at_most - 1
            assert (cases, verdict) == (first + 1, said[first])


def test_looked_at_after_every_case_the_fixed_bound_is_wrong_too_often_and_the_test_is_not() -> None:
    """2,000 campaigns at the limit; all of it is `python -m tests.met.statistics.stopping`."""
    once, peeked, watched = false_shares(0.95, 2_000, seed=11)
    most = 0.1 + 2.0 * math.sqrt(0.1 * 0.9 / 2_000)
    assert once <= most and 0.05 < watched <= most
    assert peeked > 0.3
