"""Campaigns as whole processes, to be watched and killed, and in this process, to be stopped in the midst of it.

Processes run the real command line. Sizes of tasks are set in them before it starts, so that a campaign of a few
seconds is cut as one of hours is.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from batch.campaigns.drive import Executor, Outcome
from batch.campaigns.folder import Folder, beside, uncovered
from batch.campaigns.tasks import CampaignSection, Task
from batch.executors.threads import Threads
from met.plan import Experiment
from tests.batch import plans

ROOT = Path(__file__).resolve().parents[2]

PATIENCE_SECONDS = 120.0
"""After which what a test waits for will never come."""

MET = """
import json, sys
from importlib import import_module
for name, value in json.loads(sys.argv[1]).items():
    module, _, attribute = name.rpartition(".")
    setattr(import_module(module), attribute, value)
from met.cli import main
sys.exit(main(sys.argv[2:]))
"""
"""`met` with names of modules set: `{"batch.campaigns.drive.WORK_SECONDS": 0.1}`."""

SHORT_TASKS: Mapping[str, float] = {
    "batch.campaigns.drive.WORK_SECONDS": 0.1,
    "batch.campaigns.drive.FIRST_SECONDS": 0.01,
    "batch.campaigns.performing.WORTH_SECONDS": 0.1,
}
"""Settings of campaigns that are cut as long ones are, and kept when a tenth of a second of work is done."""


# Plans


def long(cases: int, ticks: int = 60_000) -> Experiment:
    """A sweep that takes seconds, with histories that take next to nothing: 11 rows of each case."""
    experiment = plans.gains(cases, ticks=ticks)
    schedule = replace(experiment.structure.schedule, record=ticks // 10)
    return replace(experiment, structure=replace(experiment.structure, schedule=schedule))


# Whole processes


@contextlib.contextmanager
def started(
    words: Sequence[str], folder: Path, settings: Mapping[str, Any] | None = None, program: str = MET
) -> Iterator[subprocess.Popen[str]]:
    """`met` with these words, in this folder; it does not outlive the block."""
    command = [sys.executable, "-c", program, json.dumps(dict(settings or {})), *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, cwd=folder
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def met(
    words: Sequence[str], folder: Path, settings: Mapping[str, Any] | None = None, program: str = MET
) -> subprocess.CompletedProcess[str]:
    """`met` with these words, until it ends."""
    with started(words, folder, settings, program) as process:
        out, err = process.communicate(timeout=PATIENCE_SECONDS)
        return subprocess.CompletedProcess(words, process.returncode, out, err)


def until(condition: Callable[[], object], process: subprocess.Popen[str] | None = None) -> None:
    """Wait for a condition, which has to come before the process ends."""
    end = time.monotonic() + PATIENCE_SECONDS
    while not condition():
        assert time.monotonic() < end, "it never came"
        if process is not None and process.poll() is not None:
            raise AssertionError(f"it came to an end before: {process.communicate()}")
        time.sleep(0.01)


def children(process: int) -> list[int]:
    """Processes that a process has started, in all of its threads."""
    found: list[int] = []
    for path in Path(f"/proc/{process}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found += map(int, path.read_text().split())
    return found


def workers(process: int) -> list[int]:
    """Those of its children that run tasks."""
    found = []
    for child in children(process):
        with contextlib.suppress(OSError):
            if b"batch.executors.worker" in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(child)
    return found


def dead(process: int) -> bool:
    """Whether a process runs no more; nobody may have asked yet how it ended."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return True
    return state in "ZX"


# What is done


def shards(archive: Path) -> dict[str, tuple[int, int]]:
    """What is known of a campaign's shards: which file, and when it was written."""
    found = {}
    for path in folder_of(archive).shards.glob("[0-9]*"):
        told = path.stat()
        found[path.name] = (told.st_ino, told.st_mtime_ns)
    return found


def done(archive: Path, cases: int, section: int = 0) -> int:
    """Cases of a section that have a shard."""
    return cases - sum(last - first for first, last in uncovered(folder_of(archive).named_tasks(section), cases))


def run_twice(archive: Path, section: int = 0) -> list[tuple[Task, Task]]:
    """Shards that share cases."""
    found = folder_of(archive).named_tasks(section)
    return [(a, b) for a, b in pairwise(found) if b.first < a.last]


def folder_of(archive: Path) -> Folder:
    return Folder(beside(archive))


def beside_it(archive: Path) -> list[str]:
    """All that lies where the archive is."""
    return sorted(path.name for path in archive.parent.iterdir())


# In this process


def interrupt() -> None:
    """As by Ctrl-C."""
    raise KeyboardInterrupt


class Watched:
    """An executor that remembers its tasks, and does something when so many of them have ended."""

    def __init__(self, inner: Executor | None = None, after: int = 0, then: Callable[[], None] = interrupt) -> None:
        self.inner: Executor = inner or Threads(1)
        self.tasks: list[Task] = []
        self.ended = 0
        self._after, self._then = after, then

    @property
    def about(self) -> str:
        return self.inner.about

    @property
    def workers(self) -> int:
        return self.inner.workers

    @property
    def under_way(self) -> int:
        return self.inner.under_way

    @property
    def names(self) -> list[str]:
        """Of its tasks."""
        return [task.name for task in self.tasks]

    @property
    def cases(self) -> int:
        """Cases that it was given, all together."""
        return sum(task.cases for task in self.tasks)

    def open(self, folder: Folder, sections: Mapping[int, CampaignSection], tell: Callable[[], None]) -> None:
        self.inner.open(folder, sections, tell)

    def submit(self, task: Task) -> None:
        self.tasks.append(task)
        self.inner.submit(task)

    def wait(self) -> list[Outcome]:
        found = self.inner.wait()
        before, self.ended = self.ended, self.ended + len(found)
        if before < self._after <= self.ended:
            self._then()
        return found

    def close(self) -> None:
        self.inner.close()
