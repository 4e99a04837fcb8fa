"""Long sections of a campaign: shards in a tree of folders, and tasks for a thousand workers."""

from __future__ import annotations

import heapq
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.campaigns import tasks
from batch.campaigns.drive import TASKS_A_SECOND, Cutter
from batch.campaigns.folder import Folder, beside
from batch.campaigns.outcomes import CaseOutcomes
from met import run as engine
from tests.batch import begun, plans, whole


@pytest.fixture
def archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    begun.short_tasks(monkeypatch)
    monkeypatch.setattr(tasks, "STRETCH", 16)
    return tmp_path / "a.h5"


@pytest.fixture
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return batch.run(begun.plan(), output=tmp_path_factory.mktemp("whole") / "a.h5").path.read_bytes()


def in_folders(archive: Path) -> list[Path]:
    return sorted(path for path in whole.folder_of(archive).shards.glob("*/*-*-*"))


def test_shards_of_a_long_section_lie_in_folders_of_its_stretches(archive: Path) -> None:
    begun.begin(archive, after=4)
    found = Folder(beside(archive)).named_tasks(0)
    assert [task.first for task in found] == [0, 8, 16, 24][: len(found)]
    assert [path.parent.name for path in in_folders(archive)] == ["00001"] * (len(found) - 2)


@pytest.mark.slow
def test_a_campaign_whose_shards_lie_in_folders_goes_on_to_the_same_bytes(archive: Path, undisturbed: bytes) -> None:
    begun.begin(archive, after=4)
    rest, _ = begun.go_on(archive)
    assert 0 < len(rest.names) < begun.CASES // begun.OF_TASK
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_shards_that_an_older_met_wrote_beside_one_another_are_taken_up(archive: Path, undisturbed: bytes) -> None:
    begun.begin(archive, after=4)
    held = len(Folder(beside(archive)).named_tasks(0))
    for path in in_folders(archive):
        path.rename(whole.folder_of(archive).shards / path.name)
    assert len(Folder(beside(archive)).named_tasks(0)) == held
    begun.go_on(archive)
    assert archive.read_bytes() == undisturbed


def simulated(workers: int, cases: int, seconds: float) -> tuple[float, float, int]:
    """Carry out so many cases of so many seconds each, without running any: how long it takes, the share of that in
    which workers wait, and the number of tasks."""
    section = tasks.CampaignSection(0, 0, engine.prepare(plans.gains(6)), np.arange(6), False)
    cutter, left, count, busy = Cutter(section), cases, 0, 0.0
    free = [(0.0, 0)] * workers
    heapq.heapify(free)
    end = 0.0
    while left:
        at, done = heapq.heappop(free)
        if done:
            cutter.learn(done, done * seconds)
        size = cutter.size(left, workers)
        left, count, busy = left - size, count + 1, busy + size * seconds
        end = max(end, at + size * seconds)
        heapq.heappush(free, (at + size * seconds, size))
    return end, 1.0 - busy / (end * workers), count


@pytest.mark.parametrize("seconds", [1e-4, 1e-2])
def test_a_thousand_workers_ask_for_no_more_tasks_than_are_handed_out(seconds: float) -> None:
    end, waiting, count = simulated(1000, int(1000 * 120 / seconds), seconds)
    assert count / end < 3.0 * TASKS_A_SECOND
    assert waiting < 0.1


def test_few_workers_have_short_tasks() -> None:
    end, waiting, count = simulated(4, 400_000, 1e-3)
    assert 1.0 < 4 * end / count < 2.0
    assert waiting < 0.05


@pytest.mark.parametrize("seed", range(5))
def test_outcomes_that_come_in_parts_are_those_of_all_at_once(seed: int) -> None:
    rng, of = np.random.default_rng(seed), plans.gains(6)
    name = of.structure.metrics[0].name
    status = (rng.random(1000) < 0.3).astype(np.int8)
    values = np.where(status == 0, rng.integers(0, 50, 1000).astype(float), np.nan)
    values[rng.random(1000) < 0.05] = np.inf
    found = CaseOutcomes(of, {name: 20})
    edges = np.sort(rng.integers(0, 1000, 12)).tolist()
    for first, last in zip([0, *edges], [*edges, 1000], strict=True):
        found.add(status[first:last], {name: values[first:last]})
    assert found.done.select(np.arange(found.done.set)).tolist() == np.flatnonzero(status == 0).tolist()
    assert found.failed.select(np.arange(found.failed.set)).tolist() == np.flatnonzero(status != 0).tolist()
    order = [place for place in np.argsort(-values, kind="stable") if not np.isnan(values[place])]
    assert found.worst(name).tolist() == order[:20]
    finite = np.where(np.isfinite(values), values, -1.0)
    assert found.worst_finite() == [int(np.argmax(finite))]
