"""A tuning that is confirmed by cases that did not choose its design."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.answer_outcome import answer_outcome
from batch.queries.search_answers import SearchAnswer
from met import cli
from met.diagnostic import Problem
from met.plan import Plan
from met.plan.searches import Confirmation
from tests.batch.slider import swing

RUN = swing(
    "integrator = rk4;",
    "metric off = final { of = abs(slide.q); }",
    "metric top = max { of = abs(slide.qd); }",
    "require top < LIMIT m/s;",
)
DECK = (
    RUN
    + """\
sweep loads of swing { sample random(4) { links.block.mass = uniform(1.5, 2.5) kg; } }
sweep fresh of swing { sample random(30) { links.block.mass = uniform(1, 3) kg; } }
tune still of swing {
    choose environment.held.stiffness = between(2, 9) N/m;  against loads;  CONFIRM minimise off;  at_most = AT_MOST;
}
"""
)


def compiled(
    name: str, at_most: int = 130, confirm: str = "confirm fresh;", limit: float = 1.0, **words: object
) -> Plan:
    text = DECK.replace("CONFIRM", confirm).replace("AT_MOST", str(at_most)).replace("LIMIT", str(limit))
    return ic.compile(text=text, select=[name], **words)  # type: ignore[arg-type]


def answered(path: Path) -> tuple[SearchAnswer, str, str]:
    """The answer of an archive, its lines as one text, and its headline in a report."""
    with ArchiveFile(path) as file:
        answer = SearchAnswer.of(file.groups[0])
        assert answer is not None
        words = " ".join(" ".join(answer.lines()).split())
        return answer, words, answer_outcome(answer).headline


@pytest.mark.slow
def test_its_design_is_run_with_the_draws_of_another_seed_within_its_cases(tmp_path: Path) -> None:
    """The same design as of a tuning with so many cases less; and the same numbers as of a run by `--set`."""
    confirmed = batch.run(compiled("still"), output=tmp_path / "a.h5", threads=1).path
    without = batch.run(compiled("still", 100, ""), output=tmp_path / "b.h5", threads=1).path
    answer, words, _ = answered(confirmed)
    [found] = answer.search.confirmation
    with h5py.File(confirmed) as one, h5py.File(without) as other:
        stiffness = one["environment.held.stiffness"][:]
        assert len(stiffness) <= 100 and np.array_equal(stiffness, other["environment.held.stiffness"][:])
        assert "search_confirmation" not in other.attrs
    best = float(stiffness[answer.best.case])
    settings = [f"environment.held.stiffness={best!r} N/m", f"seed={answer.search.drawn_with + 1}"]
    alone = batch.run(compiled("fresh", set=settings), output=tmp_path / "c.h5", threads=1).path
    with h5py.File(alone) as data:
        assert found == Confirmation("fresh", 30, 0, 0, float(data["off"][:].max())) and found.withstood
    assert found.worst > answer.best.value and answer.ok
    worst = answer.goal(found.worst)
    assert f"confirmed by all 30 cases of fresh, which did not choose it: off is {worst} in the worst" in words


@pytest.mark.slow
def test_one_that_misses_a_requirement_in_them_is_not_what_was_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = batch.run(compiled("still"), output=tmp_path / "a.h5", threads=1).path
    with h5py.File(path) as data:
        top = float(data["top"][:].max())
    text = DECK.replace("CONFIRM", "confirm fresh;").replace("AT_MOST", "130").replace("LIMIT", str(1.02 * top))
    (tmp_path / "d.ic").write_text(text)
    out = tmp_path / "d.h5"
    assert cli.main(["run", str(tmp_path / "d.ic"), "still", "-o", str(out), "-q", "--no-picture"]) == cli.NO
    answer, words, headline = answered(out)
    [found] = answer.search.confirmation
    assert answer.best.serves and not answer.ok and 0 < found.missed < 30 and not found.failed
    assert f"not confirmed: of 30 cases of fresh, which did not choose it, {found.missed} missed a requirement" in words
    assert headline.endswith(f"in all 4 cases of loads, but not in {found.missed} of 30 of fresh")
    capsys.readouterr()
    assert cli.main(["best", str(out), "--format", "json"]) == cli.NO
    told = json.loads(capsys.readouterr().out)
    assert told["confirmation"] == [asdict(found)] and words.startswith("not advised: ")


@pytest.mark.slow
def test_no_design_that_misses_a_requirement_is_confirmed(tmp_path: Path) -> None:
    answer, words, _ = answered(batch.run(compiled("still", limit=1e-6), output=tmp_path / "a.h5", threads=1).path)
    assert not answer.best.stands and answer.search.confirmation == () and "confirmed" not in words


@pytest.mark.slow
@pytest.mark.parametrize("values", [
    '[{"against": "fresh", "cases": 30, "failed": 20, "missed": 11, "worst": 0.1}]',
    '[{"against": "fresh", "cases": 30, "failed": -1, "missed": 0, "worst": 0.1}]',
    '[{"against": "fresh", "cases": 1000000000000, "failed": 0, "missed": 0, "worst": 0.1}]',
    '[{"against": "fresh"}]',
    "{",
])  # fmt: skip
def test_counts_that_cannot_be_are_refused(tmp_path: Path, values: str) -> None:
    path = batch.run(compiled("still"), output=tmp_path / "a.h5", threads=1).path
    with h5py.File(path, "r+") as data:
        data.attrs["search_confirmation"] = values
    with pytest.raises(Problem, match="search"):
        answered(path)
