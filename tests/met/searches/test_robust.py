"""A tuning by turns finds the candidate whose worst plant is best, within its cases, and asks for none twice."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from met.plan.searches import Search, SearchedParameter
from met.searches import search_method
from met.searches.robust import RobustTuning, around, hardly_better
from met.searches.values import served

Worth = Callable[[np.ndarray], np.ndarray]
"""Cases [case, coordinate], the plant's number last -> what each is worth."""


def tuning(dimension: int, plants: list[float], at_most: int, seed: int = 0) -> Search:
    parameters = tuple(SearchedParameter(f"gain.k{n}", -1.0, 1.0) for n in range(dimension))
    own = tuple((each,) for each in plants)
    against = "spread" if plants else ""
    return Search("tune", "settle", False, parameters, at_most, seed=seed, against=against, plants=own)


def asked(search: Search, worth: Worth) -> list[np.ndarray]:
    """The generations of a tuning."""
    found, of = [], search_method(search)
    while len(cases := of.ask()):
        found.append(cases)
        of.tell(worth(cases))
    return found


def best(cases: np.ndarray, worth: Worth, plants: int) -> tuple[np.ndarray, float]:
    """The candidate that was tried with all plants and is worth most in its worst one; what that is."""
    chosen, of = np.unique(cases[:, :-1], axis=0, return_inverse=True)
    worst, tried = np.full(len(chosen), -np.inf), np.bincount(of.ravel())
    np.maximum.at(worst, of.ravel(), worth(cases))
    worst[tried < plants] = np.inf
    at = int(np.argmin(worst))
    return chosen[at], float(worst[at])


def away(cases: np.ndarray) -> np.ndarray:
    """The distance of the first number from the plant's: the least worst one is the middle of the outermost plants."""
    return np.asarray(np.abs(cases[:, 0] - cases[:, -1]) + 0.1 * np.abs(cases[:, 1:-1]).sum(axis=1))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_the_middle_between_the_outermost_plants_is_found(seed: int) -> None:
    plants = [0.1, 0.0, 0.3, -0.2, 0.62, 0.05, -0.1]
    search = tuning(2, plants, 3000, seed)
    generations = asked(search, away)
    chosen, worst = best(np.concatenate(generations), away, len(plants))
    middle, reach = 0.5 * (0.62 - 0.2), 0.5 * (0.62 + 0.2)
    assert chosen[0] == pytest.approx(middle, abs=0.01)
    assert reach <= worst <= 1.03 * reach


def test_only_plants_that_were_worst_become_active() -> None:
    plants = list(np.linspace(-0.5, 0.7, 40))
    generations = asked(tuning(1, plants, 4000), away)
    sizes = {len(np.unique(cases[:, -1])) for cases in generations if len(np.unique(cases[:, 0])) > 1}
    assert max(sizes) <= 4  # against 40 at once it would be 40


@pytest.mark.parametrize("plants", [[], [0.3], [0.1, 0.5, -0.4]])
@pytest.mark.parametrize("at_most", [20, 57, 400])
def test_it_keeps_within_its_cases_and_asks_for_each_once(plants: list[float], at_most: int) -> None:
    worth = away if plants else lambda cases: np.abs(cases).sum(axis=1)
    cases = np.concatenate(asked(tuning(2, plants, at_most), worth))
    assert 10 <= len(cases) <= at_most
    assert len(np.unique(cases, axis=0)) == len(cases)
    if plants:  # the answer was tried with all of them
        assert np.isfinite(best(cases, worth, len(plants))[1])


def test_what_is_asked_depends_on_what_was_told_alone() -> None:
    search = tuning(3, [0.2, -0.3], 500, seed=4)
    one, other = asked(search, away), asked(search, away)
    assert len(one) == len(other) and all((a == b).all() for a, b in zip(one, other, strict=True))
    changed = asked(tuning(3, [0.2, -0.3], 500, seed=5), away)
    assert not np.array_equal(one[0], changed[0])


def test_a_tuning_in_which_every_case_fails_ends() -> None:
    cases = np.concatenate(asked(tuning(2, [0.1, 0.2], 300), lambda cases: np.full(len(cases), np.inf)))
    assert 10 <= len(cases) <= 300


def test_candidates_lie_within_their_ends() -> None:
    cases = np.concatenate(asked(tuning(2, [0.9], 300), away))
    assert (np.abs(cases[:, :2]) <= 1.0).all()
    assert isinstance(search_method(tuning(2, [0.9], 300)), RobustTuning)


def test_the_middle_of_a_cube_comes_to_lie_at_a_good_point_and_its_ends_stay() -> None:
    points = np.array([[0.0, 0.5, 1.0], [0.5, 0.5, 0.5], [1.0, 0.25, 0.75]])
    found = around(np.array([0.2, 0.9, 0.0]), points)
    assert found[1] == pytest.approx([0.2, 0.9, 0.05])
    assert found[0] == pytest.approx([0.0, 0.9, 1.0]) and found[2] == pytest.approx([1.0, 0.45, 0.525])
    assert (around(None, points) == points).all()


def test_what_is_hardly_better_is_told_by_the_goal_and_not_by_how_it_is_tamed() -> None:
    goals = np.array([1e6, 1e6 * (1 - 2e-3), 1e6 * (1 - 5e-4)])
    one, other, same = served(goals, False, np.ones(3, bool), [], {}, 0.0).tolist()
    assert not hardly_better(other, one) and hardly_better(same, one)
    assert not hardly_better(1.5, 1.5), "what misses something may be mended by more cases"
