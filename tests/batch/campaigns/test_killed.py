"""Campaigns whose processes are killed, or told to end: what stays, and that running again gives the same bytes."""

from __future__ import annotations

import os
import random
import signal
import subprocess
from pathlib import Path

import pytest

import batch
from met.plan import file as plan_file
from tests.batch import plans, whole

CASES = 2_000
WAYS = (("--threads", "2"), ("--processes", "2"))
SIGNALS = (("INT", 130, "interrupted"), ("TERM", 143, "terminated"))

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The archive of a serial run that nothing happened to."""
    path = tmp_path_factory.mktemp("undisturbed") / "a.h5"
    return batch.run(plans.plan(whole.long(CASES)), output=path, threads=1).path.read_bytes()


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Where a campaign goes that takes seconds; its plan is `p.json` in the folder above."""
    plan_file.write(plans.plan(whole.long(CASES)), tmp_path / "p.json")
    (tmp_path / "out").mkdir()
    return tmp_path / "out" / "a.h5"


def words(archive: Path, *more: str) -> list[str]:
    return ["run", str(archive.parents[1] / "p.json"), "-o", str(archive), "--no-picture", *more]


def part_done(archive: Path, share: float) -> int:
    """How many cases are kept of a campaign that was killed; what killed it came neither too early nor too late."""
    kept = whole.done(archive, CASES)
    assert share * CASES <= kept < CASES
    return kept


@pytest.mark.release
def test_a_worker_that_is_killed_costs_nothing(archive: Path, undisturbed: bytes) -> None:
    with whole.started(words(archive, "--processes", "2"), archive.parent, whole.SHORT_TASKS) as process:
        whole.until(lambda: whole.done(archive, CASES) >= CASES / 3, process)
        first = whole.workers(process.pid)
        os.kill(first[0], signal.SIGKILL)
        whole.until(lambda: set(whole.workers(process.pid)) - set(first), process)  # another takes its place
        out, err = process.communicate(timeout=whole.PATIENCE_SECONDS)
    assert process.returncode == 0, err
    assert f"{CASES:,} of {CASES:,} cases reached their end" in out
    assert archive.read_bytes() == undisturbed
    assert whole.beside_it(archive) == ["a.h5", "a.h5.run.json"]


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way[0])
def test_a_driver_that_is_killed_goes_on_with_what_is_missing(
    archive: Path, undisturbed: bytes, way: tuple[str, str]
) -> None:
    before: dict[str, tuple[int, int]] = {}
    said = ""
    for share in (1 / 3, 2 / 3):
        with whole.started(words(archive, *way), archive.parent, whole.SHORT_TASKS) as process:
            whole.until(lambda share=share: whole.done(archive, CASES) >= share * CASES, process)
            theirs = whole.workers(process.pid)
            process.kill()
            said, _ = process.communicate()
        assert len(theirs) == (2 if way[0] == "--processes" else 0)
        whole.until(lambda theirs=theirs: all(whole.dead(worker) for worker in theirs))  # no orphan lives on
        part_done(archive, share)
        assert before.items() <= whole.shards(archive).items()  # those that were there are the same files
        before = whole.shards(archive)
        assert not archive.exists()
    assert "goes on: " in said
    assert whole.run_twice(archive) == []
    kept = whole.done(archive, CASES)
    last = whole.met(words(archive, *way), archive.parent, whole.SHORT_TASKS)
    assert last.returncode == 0, last.stderr
    assert f"goes on: {kept:,} of {CASES:,} cases are done\n" in last.stdout
    assert archive.read_bytes() == undisturbed
    assert whole.beside_it(archive) == ["a.h5", "a.h5.run.json"]


@pytest.mark.release
@pytest.mark.parametrize("way", WAYS, ids=lambda way: way[0])
def test_a_driver_that_is_killed_again_and_again_comes_to_the_same_end(
    archive: Path, undisturbed: bytes, way: tuple[str, str]
) -> None:
    """At any time: while it starts, reads shards, runs, writes, merges, or takes its folder away."""
    chance = random.Random(1989)
    for patience in (1.0, 1.5, 1.5, 2.0, 2.0, 2.0, 2.5, 2.5, 3.0, 4.0, whole.PATIENCE_SECONDS):
        with whole.started(words(archive, *way), archive.parent, whole.SHORT_TASKS) as process:
            try:
                process.wait(timeout=chance.uniform(0.5, 1.0) * patience)
                break
            except subprocess.TimeoutExpired:
                process.kill()
    assert process.returncode == 0, process.communicate()
    assert archive.read_bytes() == undisturbed
    assert whole.beside_it(archive) == ["a.h5", "a.h5.run.json"]


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way[0])
@pytest.mark.parametrize(("name", "status", "last"), SIGNALS)
def test_a_signal_keeps_what_is_done_and_says_how_to_go_on(
    archive: Path, undisturbed: bytes, way: tuple[str, str], name: str, status: int, last: str
) -> None:
    with whole.started(words(archive, *way), archive.parent, whole.SHORT_TASKS) as process:
        whole.until(lambda: whole.done(archive, CASES) >= 2 * CASES / 3, process)
        theirs = whole.workers(process.pid)
        process.send_signal(signal.Signals[f"SIG{name}"])
        _, said = process.communicate(timeout=whole.PATIENCE_SECONDS)
    assert process.returncode == status
    kept = part_done(archive, 2 / 3)
    folder = f"{archive}.campaign"
    end = f"\n{kept:,} of {CASES:,} cases are kept in {folder}; the same command goes on\n\nmet: {last}\n"
    assert said.endswith(end), "behind the lines of a campaign that was slow enough to tell how far it is"
    assert all(whole.dead(worker) for worker in theirs)
    assert whole.beside_it(archive) == ["a.h5.campaign"]
    assert [path for path in Path(folder).rglob("*") if path.name.endswith(".tmp")] == []
    again = whole.met(words(archive, *way), archive.parent, whole.SHORT_TASKS)
    assert again.returncode == 0, again.stderr
    assert f"goes on: {kept:,} of {CASES:,} cases are done\n" in again.stdout
    assert archive.read_bytes() == undisturbed


@pytest.mark.release
@pytest.mark.parametrize("way", WAYS, ids=lambda way: way[0])
@pytest.mark.parametrize(("name", "status", "last"), SIGNALS)
def test_an_end_before_a_second_of_work_leaves_nothing(
    archive: Path, way: tuple[str, str], name: str, status: int, last: str
) -> None:
    settings = {"batch.campaigns.drive.FIRST_SECONDS": 0.01, "batch.campaigns.drive.WORK_SECONDS": 60.0}
    with whole.started(words(archive, *way), archive.parent, settings) as process:
        whole.until(lambda: whole.done(archive, CASES), process)  # the first shard is there, of a hundredth of a second
        process.send_signal(signal.Signals[f"SIG{name}"])
        _, said = process.communicate(timeout=whole.PATIENCE_SECONDS)
    assert process.returncode == status
    assert said == f"\nmet: {last}\n"
    assert whole.beside_it(archive) == []
