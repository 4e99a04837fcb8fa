"""What is said of a difference is the same wherever it is said, and its commands run."""

from __future__ import annotations

import math
import shlex
from pathlib import Path

import numpy as np
import pytest

from batch.differences import words
from batch.differences.campaigns import diff
from batch.differences.result import EndingDiff
from batch.differences.text import diff_lines
from batch.differences.tolerance import tolerances
from met.run import Run
from tests.batch import plans
from tests.batch.differences.planted import order, two
from tests.batch.report import archives


@pytest.mark.slow
def test_each_case_is_counted_by_the_worst_of_what_differs_in_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def plant(run: Run, place: dict[int, int]) -> None:
        for case, size in ((3, 1e-9), (4, 1.0)):
            if case in place:
                run.signals["q"][place[case], 9, 0] += size
        if 5 in place:
            run.metrics["volts"][place[5]] += 1e-9
        if 6 in place:
            run.n_valid[place[6]], run.status[place[6]] = 20, 1
            run.signals["qd"][place[6], 20:] = math.nan

    mixed = order(11, 30)
    a, b = two(monkeypatch, tmp_path, mixed, plant, cases=30)
    [found] = diff(a, b, tolerances(["q=1e-6rad,volts=1e-6V"])).experiments
    expected = np.zeros(30, int)
    expected[[3, 5]], expected[[4, 6]] = 1, 2
    assert found.how.tolist() == expected.tolist()


@pytest.mark.slow
def test_a_command_names_the_run_where_there_are_several(
    here: Path, engine: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    archives.made(here / "a.h5", plans.nominal(), plans.gains(3))

    def answer(*args: object, **options: object) -> Run:
        found: Run = plans.answer(*args, **options)  # type: ignore[arg-type]
        found.metrics["volts"] += 1.0
        return found

    monkeypatch.setattr("met.run.run", answer)
    archives.made(here / "b.h5", plans.nominal(), plans.gains(3))
    found = diff("a.h5", "b.h5")
    for experiment in found.experiments:
        commands = words.replay_commands(found, experiment, experiment.worst[0])
        assert [shlex.split(each)[2:4] for each in commands] == [
            ["a.h5", experiment.name_a],
            ["b.h5", experiment.name_b],
        ]
        assert f"      {'; '.join(commands)}" in diff_lines(found)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (0, 1, "1 case fails that did not"),
        (0, 2, "1 case is timed out that was done"),
        (1, 0, "1 case is done that failed"),
        (3, 0, "1 case is done that was lost"),
        (1, 2, "1 case is timed out that was failed"),
        (1, 1, "1 case failed earlier or later"),
    ],
)
def test_how_a_case_ends_otherwise(before: int, after: int, said: str) -> None:
    from types import SimpleNamespace

    ended = [EndingDiff(7, "8f3a", before, after, "it was stuck", "it broke" if after else "", 3, 5)]
    [ending] = words.endings(SimpleNamespace(ended=ended))  # type: ignore[arg-type]
    assert (ending.text, ending.cases) == (said, "#7")
    assert words.cause(ended[0]) == ("it broke" if after else "before: it was stuck")
