"""The starts of a tuning: how many came to its answer, what is said where they did not, and texts that none writes."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import h5py
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.search_answers import SearchAnswer
from met.diagnostic import Problem
from tests.batch.campaigns.test_searching import DECK

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of the tuning alone."""
    output = tmp_path_factory.mktemp("starts") / "tuned.h5"
    return batch.run(ic.compile(text=DECK, select=["still"]), output=output, threads=1).path


def with_starts(tuned: Path, folder: Path, text: str) -> Path:
    """The archive with this in place of what it says of its starts."""
    shutil.copy(tuned, folder / "other.h5")
    with h5py.File(folder / "other.h5", "r+") as data:
        data.attrs["search_starts"] = text
    return folder / "other.h5"


def test_a_tuning_says_how_many_of_its_starts_came_to_its_answer(tuned: Path, tmp_path: Path) -> None:
    def lines(text: str) -> list[str]:
        with ArchiveFile(with_starts(tuned, tmp_path, text)) as file:
            found = SearchAnswer.of(file.groups[0])
            assert found is not None
            return found.lines()

    with ArchiveFile(tuned) as file:
        answer = SearchAnswer.of(file.groups[0])
        assert answer is not None
        first, second, third = answer.search.starts
        near, again, none = answer.starts
        assert near == answer.found.value and near < again < 1.02 * near and math.isnan(none)
        assert "  2 of its 3 starts came to within 2 % of one another" in answer.lines()
        assert first.first == 0 and third.best == -1
    alone = lines(json.dumps([{"first": 0, "best": first.best}]))
    assert "not sure that it is the best: there was one start alone" in "\n".join(alone)
    worse = lines(json.dumps([{"first": 0, "best": first.best}, {"first": second.first, "best": second.first}]))
    assert "not sure that it is the best: of 2 starts one alone came to " in "\n".join(worse)
    assert not [line for line in lines("[]") if "start" in line], "made before starts were kept"


@pytest.mark.parametrize("text", [
    '[{"first": 1, "best": 2}]',
    '[{"first": 0, "best": 5}, {"first": 3, "best": 4}]',
    '[{"first": 0, "best": 1000000000}]',
    '[{"first": 0, "best": 0}, {"first": 0, "best": 1}]',
    "{",
    '["a"]',
])  # fmt: skip
def test_starts_that_cannot_be_are_refused(text: str, tuned: Path, tmp_path: Path) -> None:
    with pytest.raises(Problem, match="search"), ArchiveFile(with_starts(tuned, tmp_path, text)):
        pass
