"""The unit of work of every campaign: run some cases of a section, and write one shard.

A section is cases of one experiment that are run alike, with their histories or without; a task is a stretch of them.
The results do not depend on how cases are cut into tasks, or on who runs them.

A shard is a file with its own checksum:

    line       MET shard 1
    8 bytes    length of the head, little-endian
    head       JSON: key, seconds, fates, arrays with their types and shapes
    arrays     outputs [case, output], history [case, row, column]; little-endian, one after the other
    32 bytes   SHA-256 of all before

It gets its name only when it is whole and on the disk. Still, `shard_of_file` checks the sum, and its caller compares
the key, which covers everything that decided the numbers. A shard from another plan, cut short, or with a bit turned
over, does not count.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from met import run as engine
from met.analysis.linear import metrics as linear_metrics
from met.frozen import frozen
from met.host.files import is_count, memory, open_regular, parse_json, whole_file
from met.passing import Memories
from met.plan.columns import BLOCK, CaseValues
from met.run import FAILED, LOST, TIMED_OUT, Prepared

MAGIC = b"MET shard 1\n"
SUM = hashlib.sha256
SUM_BYTES = SUM().digest_size
TYPES: dict[str, np.dtype[Any]] = {"f8": np.dtype("<f8"), "f4": np.dtype("<f4")}

HEAD_BYTES = 64 << 20
"""Largest size of a shard's head, bytes: the reasons why cases were not run take most of it."""


class UnsoundShard(Exception):
    """Raised for a file that does not count as a shard, with the reason, in words that follow its name."""


@frozen
class Shard:
    """The results of a task.

    key       of all that decided it (`tasks.CampaignSection.key`)
    outputs   [case, output]
    history   [case, row, column], float64 or float32; None where none is kept
    seconds   of computing
    fates     of cases that were not run, by their place here: status and why
    """

    key: str
    outputs: np.ndarray
    history: np.ndarray | None
    seconds: float
    fates: Mapping[int, tuple[int, str]] = field(default_factory=dict)

    @property
    def failed(self) -> int:
        """The number of cases that did not reach their end."""
        return self.failed_from(0)

    def failed_from(self, first: int) -> int:
        """The number of cases, from the `first` one on, that did not reach their end."""
        first = max(first, 0)
        return int(np.count_nonzero(self.outputs[first:, 0])) + sum(case >= first for case in self.fates)


def write_shard(path: Path, shard: Shard) -> None:
    """Write a shard whole, or not at all. Raises OSError."""
    arrays = {"outputs": shard.outputs, **({} if shard.history is None else {"history": shard.history})}
    head = {
        "key": shard.key,
        "seconds": shard.seconds,
        "fates": [[case, *fate] for case, fate in shard.fates.items()],
        "arrays": [[name, _type(array), list(array.shape)] for name, array in arrays.items()],
    }
    text = json.dumps(head).encode()
    parts: list[Any] = [MAGIC, len(text).to_bytes(8, "little"), text]
    parts += [np.ascontiguousarray(a, TYPES[_type(a)]).data.cast("B") for a in arrays.values() if a.size]
    summed = SUM()
    with whole_file(path) as file:
        for part in parts:
            summed.update(part)
            file.write(part)
        file.write(summed.digest())


def shard_of_file(path: Path, most: int | None = None) -> Shard:
    """The shard in a file; its arrays are writable. most: largest number of bytes. Raises UnsoundShard, OSError."""
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > (memory() if most is None else most + HEAD_BYTES):
            raise UnsoundShard("is larger than its cases make it")
        data = bytearray(size)
        got = file.readinto(data)
    if got < len(data) or len(data) < len(MAGIC) + 8 + SUM_BYTES:
        raise UnsoundShard("is cut short")
    if not data.startswith(MAGIC):
        raise UnsoundShard("is no shard of this version of MET")
    body = memoryview(data)[:-SUM_BYTES]
    if SUM(body).digest() != data[-SUM_BYTES:]:
        raise UnsoundShard("is not what was written: its checksum differs")
    head_start = len(MAGIC) + 8
    end = head_start + int.from_bytes(data[len(MAGIC) : head_start], "little")
    try:
        return _shard_of(parse_json(bytes(body[head_start:end])), data, end)
    except (ValueError, LookupError, TypeError, AttributeError) as reason:
        raise UnsoundShard("has a head that does not go with what follows it") from reason


def _shard_of(head: Any, data: bytearray, start: int) -> Shard:
    """The shard with this head, whose arrays begin at a place of its file. Raises ValueError and the like for an
    invalid head, whose checksum may be right if it was forged."""
    arrays = {}
    for name, kind, shape in head["arrays"]:
        if not all(map(is_count, shape)):
            raise ValueError(shape)
        size = math.prod(shape)
        if start + size * TYPES[kind].itemsize > len(data) - SUM_BYTES:
            raise ValueError(shape)
        arrays[name] = np.frombuffer(data, TYPES[kind], size, start).reshape(shape)
        start += size * TYPES[kind].itemsize
    outputs, history, seconds = arrays.pop("outputs"), arrays.pop("history", None), float(head["seconds"])
    if arrays or start != len(data) - SUM_BYTES or outputs.ndim != 2 or outputs.dtype != TYPES["f8"] or seconds < 0.0:
        raise ValueError(head)
    if history is not None and (history.ndim != 3 or len(history) != len(outputs)):
        raise ValueError(head)
    fates = {case: (status, why) for case, status, why in head["fates"]}
    for case, (status, why) in fates.items():
        if not is_count(case, len(outputs) - 1) or status not in (FAILED, TIMED_OUT, LOST) or not isinstance(why, str):
            raise ValueError(case)
    if not isinstance(head["key"], str):
        raise ValueError(head)
    return Shard(head["key"], outputs, history, seconds, fates)


def cannot_keep(folder: Path, reason: OSError) -> str:
    """The error that a shard cannot be written."""
    return f"cannot keep what was computed in {folder}: {(reason.strerror or str(reason)).lower()}"


def _type(array: np.ndarray) -> str:
    return "f4" if array.dtype == np.float32 else "f8"


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


def keep(folder: Path, task: Task, new_shard: Shard) -> None:
    """Write a task's shard into its place in the folder of shards. Raises OSError."""
    path = folder / task.path
    if path.parent != folder:
        path.parent.mkdir(exist_ok=True)
    write_shard(path, new_shard)


def compute(
    section: CampaignSection, task: Task, *, threads: int | None = None, progress: Callable[[int], None] | None = None
) -> Shard:
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
    return Shard(
        key=section.key(task.first, task.last), outputs=outputs, history=history, seconds=time.perf_counter() - began
    )


def not_run(section: CampaignSection, task: Task, ended: int, why: str) -> Shard:
    """The shard of cases that could not be run: `met.run.TIMED_OUT` or `LOST`, and why."""
    width = len(section.prepared.outputs)
    history = None
    if section.recorded and section.prepared.program.columns:
        shape = (task.cases, section.prepared.experiment.structure.schedule.rows, section.prepared.program.columns)
        history = np.full(shape, np.nan, np.float32 if section.single else np.float64)
    fates = dict.fromkeys(range(task.cases), (ended, why))
    return Shard(section.key(task.first, task.last), np.zeros((task.cases, width)), history, 0.0, fates)
