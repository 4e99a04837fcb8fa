"""What the answer of a search or a tuning says of how sure it is."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.search_answers import SearchAnswer
from met.diagnostic import Problem
from met.plan.codec import encode
from met.plan.searches import JudgedDesign, LeastMargins
from tests.batch.campaigns.test_searching import DECK

Said = Callable[..., tuple[SearchAnswer, str]]


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of a tuning of three starts, of which two came to its answer and one to none."""
    folder = tmp_path_factory.mktemp("sureness")
    (folder / "d.ic").write_text(DECK)
    return batch.run(ic.compile(str(folder / "d.ic"), select=["still"]), output=str(folder / "t.h5"), threads=1).path


@pytest.fixture
def said(tuned: Path, tmp_path: Path) -> Said:
    """The answer of the archive with these attributes, and its lines as one text."""

    def of(**attributes: object) -> tuple[SearchAnswer, str]:
        shutil.copy(tuned, tmp_path / "t.h5")
        with h5py.File(tmp_path / "t.h5", "r+") as data:
            data["still" if "still" in data else "/"].attrs.update(attributes)
        with ArchiveFile(tmp_path / "t.h5") as file:
            found = SearchAnswer.of(file.groups[0])
            assert found is not None
            return found, " ".join(" ".join(found.lines()).split())

    return of


@pytest.mark.slow
def test_a_tuning_says_how_many_of_its_starts_came_to_its_answer(said: Said) -> None:
    answer, words = said()
    first, second, third = answer.search.starts
    near, again, none = answer.starts
    assert near == answer.best.value and near < again < 1.02 * near and math.isnan(none)
    assert "2 of its 3 starts came to within 2 % of one another" in words
    assert first.first == 0 and third.best == -1
    _, words = said(search_starts=json.dumps([{"first": 0, "best": first.best}]))
    assert "not sure that it is the best: there was one start alone" in words
    apart = [{"first": 0, "best": first.best}, {"first": second.first, "best": second.first}]
    assert "not sure that it is the best: of 2 starts one alone came to " in said(search_starts=json.dumps(apart))[1]
    assert "start" not in said(search_starts="[]")[1], "made before starts were kept"


@pytest.mark.slow
def test_a_tuning_that_is_not_advised_says_too_how_many_starts_came_to_its_answer(said: Said) -> None:
    """A goal that is not the best is no less so for want of a margin."""
    best = said()[0].search.starts[0].best
    unstable = LeastMargins(0.0, 1.0, 0.0, ("slide",), best, 0.0, 1, 5, 15)
    _, words = said(search_judged=json.dumps(encode(tuple[JudgedDesign, ...], (JudgedDesign(best, unstable),))))
    assert words.startswith("not advised: ") and "2 of its 3 starts came to within 2 % of one another" in words


@pytest.mark.slow
def test_a_tuning_names_the_nearest_of_its_candidates_that_is_worse_by_one_percent(tuned: Path) -> None:
    """Found here by a look at one case after another: a goal that is worse with one plant is worse with all."""
    with ArchiveFile(tuned) as file:
        group = file.groups[0]
        answer = SearchAnswer.of(group)
        assert answer is not None
        goals, stiffness = group.values("off").tolist(), group.values("environment.held.stiffness").tolist()
        best, found = stiffness[answer.best.case], answer.as_data()["nearest_worse"]
        away = [abs(each - best) / (9.0 - 2.0) for each in stiffness]
        place = min((n for n, goal in enumerate(goals) if goal > 1.01 * answer.best.value), key=lambda n: away[n])
        assert found == {"case": place, "distance": pytest.approx(away[place], rel=1e-12)} and 0.0 < away[place] < 0.05
        words = " ".join(" ".join(answer.lines()).split())
    far = f"{100.0 * away[place]:.2g} % of a range away, case #{place} with environment.held.stiffness = "
    assert f"nearest tried that is worse by more than 1 %: {far}" in words


@pytest.mark.slow
def test_no_candidate_is_a_percent_worse_than_a_goal_of_nothing(tuned: Path, tmp_path: Path) -> None:
    shutil.copy(tuned, tmp_path / "zero.h5")
    with h5py.File(tmp_path / "zero.h5", "r+") as data:
        data["off"][:] = np.where(data["off"][:] < 0.05, 0.0, data["off"][:])
    with ArchiveFile(tmp_path / "zero.h5") as file:
        answer = SearchAnswer.of(file.groups[0])
        assert answer is not None and answer.best.stands and answer.best.value == 0.0
        assert answer.as_data()["nearest_worse"] is None and "worse by" not in " ".join(answer.lines())


@pytest.mark.slow
def test_a_search_says_what_the_second_half_of_its_cases_brought(tmp_path: Path) -> None:
    (tmp_path / "d.ic").write_text(DECK)
    path = batch.run(ic.compile(str(tmp_path / "d.ic"), select=["back"]), output=str(tmp_path / "s.h5"), threads=1).path
    with ArchiveFile(path) as file:
        found = SearchAnswer.of(file.groups[0])
        assert found is not None
        far, half = file.groups[0].values("far"), file.groups[0].count // 2
        assert "  the second half of its cases found nothing that is worse by more than 2 %" in found.lines()
        assert far[:half].min() == pytest.approx(far.min(), rel=0.02)
    with h5py.File(path, "r+") as data:
        data["far"][:half] = np.maximum(far[:half], -0.05)
    with ArchiveFile(path) as file:
        found = SearchAnswer.of(file.groups[0])
        assert found is not None
        words = " ".join(" ".join(found.lines()).split())
    assert "not sure that it is the worst: the first half of its cases came to -0.05 m; another `seed` or " in words


@pytest.mark.slow
def test_a_better_design_that_misses_the_margin_is_explained_by_what_the_tuning_asked_for(said: Said) -> None:
    """By the goal alone; or with a written least margin, by it where the cases begin."""
    best, other = (start.best for start in said()[0].search.starts[:2])
    keeps = LeastMargins(0.5, 2.0, 0.1, ("slide",), other, 0.0, 1, 5, 15)
    judged = (JudgedDesign(best, replace(keeps, disk=0.2, case=best)), JudgedDesign(other, keeps))
    text = json.dumps(encode(tuple[JudgedDesign, ...], judged))
    _, alone = said(search_judged=text, search_steers=0)
    _, steered = said(search_judged=text, search_steers=1)
    begins = "not sure that it is the best with its margin: the tuning "
    assert begins + "went by the goal alone; `least_margin = 0.3;` in it makes it look for one that keeps it" in alone
    asks = "asks for it only where its cases begin, and the best by the goal does not keep it"
    assert begins + asks in steered and "goal alone" not in steered


@pytest.mark.slow
@pytest.mark.parametrize("text", [
    '[{"first": 1, "best": 2}]',
    '[{"first": 0, "best": 5}, {"first": 3, "best": 4}]',
    '[{"first": 0, "best": 1000000000}]',
    '[{"first": 0, "best": 0}, {"first": 0, "best": 1}]',
    "{",
    '["a"]',
])  # fmt: skip
def test_starts_that_cannot_be_are_refused(text: str, said: Said) -> None:
    with pytest.raises(Problem, match="search"):
        said(search_starts=text)
