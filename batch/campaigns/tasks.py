"""The unit of work of every campaign: run some cases of a section, and write one shard.

A section is cases of one experiment that are run alike, with their histories or without; a task is a stretch of them.
The results do not depend on how cases are cut into tasks, or on who runs them.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from batch.campaigns import shard
from met import run as engine
from met.analysis.linear import metrics as linear_metrics
from met.frozen import frozen
from met.passing import Memories
from met.plan.columns import BLOCK, CaseValues
from met.run import Prepared

GRANULE = 32
"""The number of cases of a task is a multiple of this, the widest block of a kernel, where there are enough."""

MOST_CASES = 1 << 18
"""Largest number of cases of a task without histories."""

STRETCH = 1 << 16
"""Number of cases whose shards lie in one folder: some thousand files at most, since tasks have `GRANULE` cases or
more."""

MOST_BYTES = 128 << 20
"""Largest size of the histories of a task, which are in memory together."""


@frozen
class CampaignSection:
    """Cases of one experiment that are run alike.

    number      in its campaign;  experiment: its number in the plan
    rows        of the case table, [case]
    recorded    whether histories are kept;  single: as numbers of four bytes
    begun       key of the program that the campaign was begun with, where it is of an older kind than ours for the same
    memories    gets the memory of its cases at some instants, of those that this process runs; None: it is not wanted
    """

    number: int
    experiment: int
    prepared: Prepared
    rows: CaseValues
    recorded: bool
    single: bool = False
    begun: str = ""
    memories: Memories | None = None

    @property
    def code(self) -> str:
        """Key of the program, as the campaign has it."""
        return self.begun or self.prepared.work_key

    @property
    def name(self) -> str:
        """The user's name of the experiment."""
        return self.prepared.experiment.name

    @property
    def most(self) -> int:
        """Largest number of cases of a task."""
        if not self.recorded:
            return MOST_CASES
        cases = max(1, min(MOST_CASES, MOST_BYTES // self.prepared.experiment.structure.history_bytes))
        return cases if cases < GRANULE else cases // GRANULE * GRANULE

    def key(self, first: int = 0, last: int | None = None) -> str:
        """A digest of everything that decides the results of these cases: code, duration, inputs, and the records
        kept."""
        experiment = self.prepared.experiment
        last = len(self.rows) if last is None else last
        record_kind = ("recorded" if self.recorded else "outputs", "f4" if self.single else "f8")
        shape = (last - first, len(experiment.cases.coordinates) + len(experiment.cases.noise))
        key_parts = (self.code, experiment.structure.schedule.ticks, *record_kind, shape)
        summed = hashlib.sha256(f"{key_parts}\n".encode())
        for start in range(first, last, BLOCK):
            summed.update(engine.inputs(experiment, self.rows[start : min(start + BLOCK, last)]).tobytes())
        return summed.hexdigest()


@frozen
class Task:
    """Cases `first` to `last` (exclusive) of a section, by their places in its rows."""

    section: int
    first: int
    last: int

    @property
    def cases(self) -> int:
        return self.last - self.first

    @property
    def name(self) -> str:
        """The file name of the task's shard."""
        return f"{self.section}-{self.first:09}-{self.last:09}"

    @property
    def path(self) -> str:
        """The path of the task's shard below `shards/`: those of a long section are in one folder for each stretch of
        cases, so that no folder has very many files."""
        return self.name if self.first < STRETCH else f"{self.first // STRETCH:05}/{self.name}"


@frozen
class Done:
    """A task that was carried out: its computing time, s, and the number of its failed cases."""

    seconds: float
    failed: int


def carry_out(
    section: CampaignSection,
    task: Task,
    folder: Path,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    computed: Callable[[], None] = lambda: None,
) -> Done:
    """Run a task's cases and write its shard into the folder. computed: called in between."""
    new_shard = compute(section, task, threads=threads, progress=progress)
    computed()
    keep(folder, task, new_shard)
    return Done(new_shard.seconds, new_shard.failed)


def keep(folder: Path, task: Task, new_shard: shard.Shard) -> None:
    """Write a task's shard into its place in the folder of shards. Raises OSError."""
    path = folder / task.path
    if path.parent != folder:
        path.parent.mkdir(exist_ok=True)
    shard.write(path, new_shard)


def compute(
    section: CampaignSection, task: Task, *, threads: int | None = None, progress: Callable[[int], None] | None = None
) -> shard.Shard:
    """Run a task's cases and return their shard."""
    section.prepared.kernel  # noqa: B018 - compiling is not computing
    began = time.perf_counter()
    rows = section.rows[task.first : task.last]
    history, outputs = linear_metrics.compute(
        section.prepared,
        rows,
        threads=threads,
        record=section.recorded,
        progress=progress,
        memories=section.memories,
    )
    if history is not None and section.single:
        with np.errstate(over="ignore"):  # numbers too large for four bytes become infinite
            history = history.astype(np.float32)
    return shard.Shard(
        key=section.key(task.first, task.last), outputs=outputs, history=history, seconds=time.perf_counter() - began
    )


def not_run(section: CampaignSection, task: Task, ended: int, why: str) -> shard.Shard:
    """The shard of cases that could not be run: `met.run.TIMED_OUT` or `LOST`, and why."""
    width = len(section.prepared.outputs)
    history = None
    if section.recorded and section.prepared.program.columns:
        shape = (task.cases, section.prepared.experiment.structure.schedule.rows, section.prepared.program.columns)
        history = np.full(shape, np.nan, np.float32 if section.single else np.float64)
    fates = dict.fromkeys(range(task.cases), (ended, why))
    key = section.key(task.first, task.last)
    return shard.Shard(key, np.zeros((task.cases, width)), history, 0.0, fates)
