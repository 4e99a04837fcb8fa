"""The answer of a search says which of its parameters stand at an end of their range."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from met.frozen import frozen
from met.plan.searches import Search, SearchedParameter
from met.searches.answer import NearestMiss, answer


@pytest.mark.parametrize(
    ("low", "high", "inside"),
    [(0.01, 1.0, 0.1), (1e-300, 1e300, 1.0), (-1e300, -1e-300, -1.0), (1e-300, 1e-290, 1e-295)],
)
def test_ends_of_equal_ratios_are_told_however_far_apart(low: float, high: float, inside: float) -> None:
    search = Search("search", "effort", True, (SearchedParameter("kp", low, high, logarithmic=True),), 1)
    for value, ends in ((low, (("kp", "lower"),)), (inside, ()), (high, (("kp", "upper"),))):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = answer(search, np.array([[value]]), np.array([True]), {"effort": np.array([2.0])}, [])
        assert found.ends == ends


@frozen
class Below:
    """`over` below 10."""

    metric: str = "over"
    comparison: str = "<"
    limit: float = 10.0
    text: str = "over < 10"


def tuned(table: list[list[float]], done: list[bool], over: list[float]) -> NearestMiss | None:
    """The nearest miss of a tuning of `kp` from 0.01 to 1 by ratios and `ki` from 0 to 1, which has one plant."""
    parameters = (SearchedParameter("kp", 0.01, 1.0, logarithmic=True), SearchedParameter("ki", 0.0, 1.0))
    search = Search("tune", "settle", False, parameters, 100)
    settle = np.arange(float(len(table)))
    return answer(search, np.array(table), np.array(done), {"settle": settle, "over": np.array(over)}, [Below()]).miss


def test_the_nearest_candidate_that_misses_something_is_told_by_the_parameter_that_is_farthest() -> None:
    far, near = [0.1, 0.9], [0.3, 0.55]  # log10(3) / 2 of the range of kp, and 0.05 of that of ki
    found = tuned([[0.1, 0.5], far, near, [0.11, 0.51]], [True] * 4, [1.0, 11.0, 12.0, 9.0])
    assert found is not None
    assert (found.case, found.text) == (2, "over < 10")
    assert found.distance == pytest.approx(np.log10(3.0) / 2.0, rel=1e-12)


def test_a_candidate_that_fails_is_a_miss_without_a_requirement() -> None:
    found = tuned([[0.1, 0.5], [0.1, 0.6]], [True, False], [1.0, np.nan])
    assert found is not None
    assert (found.case, found.text) == (1, "")
    assert found.distance == pytest.approx(0.1, rel=1e-12)


def test_where_all_candidates_meet_all_there_is_no_miss() -> None:
    assert tuned([[0.1, 0.5], [0.1, 0.6]], [True, True], [1.0, 2.0]) is None
