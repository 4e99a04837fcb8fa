"""Putting shards together: a case that is run again for its history must have given the same numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import batch
from batch.campaigns import tasks
from met import run as engine
from met.diagnostic import Problem
from tests.batch import plans


def test_a_case_that_gives_other_numbers_when_it_is_run_again_stops_the_merge(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = tasks.write_shard

    def wrong(path: Path, made: tasks.Shard) -> None:
        if made.history is not None:
            made.outputs[1, -1] += 1e-12
        write(path, made)

    monkeypatch.setattr(tasks, "write_shard", wrong)
    with pytest.raises(Problem) as caught:
        batch.run(plans.plan(plans.gains(9)), output="a.h5", histories=["every:4"])
    [told] = caught.value.diagnostics
    assert told.code == "E352"
    assert told.message == "case #4 of `gains` gave other numbers when it was run again for its history"
    assert not (here / "a.h5").exists()


@pytest.mark.release
def test_the_code_of_a_plan_is_that_of_its_file(tmp_path: Path) -> None:
    """Workers read the plan from a file: a shard of theirs must count here."""
    import ic
    from met.plan import file as plan_file

    for deck in ("two_link.ic", "panda.ic", "puma_560.ic"):
        plan = ic.compile(deck, select="all")
        again: Any = plan_file.loads(plan_file.dumps(plan))
        for one, other in zip(plan.experiments, again.experiments, strict=True):
            assert engine.prepare(one).code_key == engine.prepare(other).code_key, (deck, one.name)
