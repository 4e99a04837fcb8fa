"""What a case is worth: failures hurt most in a search and are worst in a tuning, and tiers keep their order."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
import pytest

from met.plan.searches import SearchedParameter
from met.searches.values import MET, MISSED, UNKNOWN, hurt, missed, served, short


@dataclass(frozen=True)
class Limit:
    metric: str
    comparison: str
    limit: float


def served_of(rows: list[tuple[float, float, bool]], limit: Limit, margin: float = 0.0) -> list[float]:
    """What cases of (goal, other, done) are worth, with a limit of the other."""
    goal, other = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    done = np.array([row[2] for row in rows])
    return served(goal, False, done, [limit], {"goal": goal, "other": other}, margin).tolist()


def test_a_failure_and_a_goal_without_a_value_hurt_infinitely() -> None:
    goal, done = np.array([1.0, -2.0, np.nan, 5.0]), np.array([True, True, True, False])
    assert hurt(goal, True, done).tolist() == [-1.0, 2.0, -np.inf, -np.inf]
    assert hurt(goal, False, done).tolist() == [1.0, -2.0, -np.inf, -np.inf]


def test_any_case_that_meets_all_is_better_than_any_that_does_not() -> None:
    limit = Limit("other", "<", 2.0)
    rows = [(1e6, 1.0, True), (-1e6, 2.1, True), (0.0, np.inf, True), (0.0, np.nan, True), (0.0, 1.0, False)]
    found = served_of(rows, limit)
    assert found == sorted(found) and len(set(found)) == len(found)
    assert found[0] < MET <= found[1] < found[2] <= MISSED < found[3] <= UNKNOWN < found[4] == np.inf


def test_among_those_that_meet_all_the_goal_decides_and_among_others_what_is_missed() -> None:
    limit = Limit("other", ">=", -3.0)
    good = served_of([(goal, 0.0, True) for goal in (-1e5, -2.0, 0.0, 1e-9, 3.0, 1e7)], limit)
    assert good == sorted(good) and len(set(good)) == len(good)
    bad = served_of([(0.0, other, True) for other in (-3.1, -4.0, -50.0, -np.inf)], limit)
    assert bad == sorted(bad) and len(set(bad)) == len(bad)
    assert served_of([(9.0, -4.0, True)], limit) == [bad[1]]  # whatever the goal is


@pytest.mark.parametrize(("comparison", "met"), [("<", False), ("<=", True), (">", False), (">=", True)])
def test_a_value_on_its_limit_meets_what_includes_it(comparison: str, met: bool) -> None:
    assert (served_of([(0.0, 2.0, True)], Limit("other", comparison, 2.0))[0] < MET) is met


def test_a_margin_is_a_share_of_the_limit_and_costs_as_large_a_share_of_the_goal() -> None:
    limit = Limit("other", "<", -10.0)
    values = np.array([-10.0, -10.25, -10.5, -12.0, np.nan])
    assert short(limit, values, 0.05).tolist() == pytest.approx([1.0, 0.5, 0.0, 0.0, np.nan], nan_ok=True)
    assert short(Limit("other", ">", 0.0), values, 0.05).tolist() == [0.0] * 5
    on_it, inside, better = served_of(
        [(2.0, -10.0 - 1e-12, True), (2.1, -10.5, True), (1.99, -10.5, True)], limit, 0.05
    )
    assert on_it == pytest.approx(inside, rel=1e-9), "2 on the limit is as good as 2.1 that keeps 5 % from it"
    assert better < on_it
    negative = served_of([(-2.0, -10.0 - 1e-12, True), (-1.9, -10.5, True)], limit, 0.05)
    assert negative[0] == pytest.approx(negative[1], rel=1e-9)


def test_what_is_missed_is_a_share_of_the_limit() -> None:
    assert missed(Limit("other", "<", -10.0), np.array([-10.4, -9.0, np.nan])).tolist() == pytest.approx(
        [0.0, 0.1, np.nan], nan_ok=True
    )
    assert missed(Limit("other", ">", 0.0), np.array([0.1, -0.3])).tolist() == pytest.approx([0.0, 0.3])


def test_without_requirements_the_goal_alone_decides() -> None:
    goal = np.array([3.0, -1.0, np.nan, np.inf])
    found = served(goal, True, np.ones(4, bool), [], {"goal": goal}, 0.0)
    assert np.argsort(found).tolist() == [3, 0, 1, 2]


@pytest.mark.parametrize(
    ("low", "high"), [(1e-300, 1e300), (-1e300, -1e-300), (1e-200, 1e-190), (5e-324, 1.7e308), (0.02, 3.0)]
)
def test_equal_ratios_are_equal_steps_however_far_apart_the_ends_are(low: float, high: float) -> None:
    at = np.linspace(0.0, 1.0, 21)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        values = SearchedParameter("kp", low, high, logarithmic=True).values(at)
    assert (np.diff(values) > 0.0).all() and values[0] == low and values[-1] == high
    exact = [math.log(abs(low)) * (1.0 - share) + math.log(abs(high)) * share for share in at.tolist()]
    assert np.log(np.abs(values))[1:-1] == pytest.approx(exact[1:-1], abs=1e-9)
