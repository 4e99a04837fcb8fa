"""Merging of a campaign's shards into its archive: in order, a bounded number of cases at a time, each shard checked
again.

One thread writes, for HDF5 has no more; others read and prove the shards and make what is written, some stretches
ahead of it. What is written, and in which pieces, does not depend on them.
"""

from __future__ import annotations

import contextlib
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from batch.campaigns.folder import Folder
from batch.campaigns.outcomes import CaseOutcomes
from batch.campaigns.tasks import CampaignSection, Shard, Task, UnsoundShard, write_shard
from met import run as engine
from met.diagnostic import Problem, error
from met.plan.columns import places_among
from met.run import Run

if TYPE_CHECKING:
    from batch.archive.write import ArchiveWriter

BLOCK = 1 << 16
"""Number of cases that are written at a time, however they were run: HDF5's placing of strings depends on it."""


AHEAD = 2
"""Number of shards that are read, and of blocks that are made, while one is written."""

T = TypeVar("T")


class Missing(Exception):
    """Raised where a shard does not count any more, with the reason. Its cases have to be run again."""


def merge(
    writer: ArchiveWriter,
    number: int,
    folder: Folder,
    values: CampaignSection,
    histories: CampaignSection | None,
    progress: Callable[[int], None],
    *,
    threads: int | None = None,
) -> CaseOutcomes:
    """Write one experiment's cases into the archive, from the shards (files of tasks' results); returns their outcomes.
    Raises Missing.

    values     all of its cases;  histories: those that were run again for them
    progress   told how many cases are written
    threads    that read shards and make what is written; None: one a processor
    """
    history_rows = histories.rows if histories is not None else np.empty(0, np.int64)
    places = places_among(values.rows, np.asarray(history_rows))
    outcomes = CaseOutcomes(values.prepared.experiment)
    before: list[np.ndarray] = []
    ended: dict[int, tuple[int, str]] = {}

    def block_results(
        first: int, outputs: np.ndarray, fates: dict[int, tuple[int, str]]
    ) -> tuple[int, Run, Mapping[str, Any]]:
        """The results of a block of cases, and the values of their variables in the archive."""
        run = _results(values, first, outputs, None, fates)
        return first, run, writer.case_values(number, run)

    def shards(pool: ThreadPoolExecutor) -> Iterator[tuple[int, Shard]]:
        """The section's shards in order, with the place of the first case; their histories are written on the way."""
        for start, read_shard in shards_in_order(folder, values, pool):
            if read_shard.history is not None:
                run = _results(values, start, read_shard.outputs.copy(), read_shard.history, dict(read_shard.fates))
                writer.put_signals(number, start, run)
            yield start, read_shard

    def calls(pool: ThreadPoolExecutor) -> Iterator[Callable[[], tuple[int, Run, Mapping[str, Any]]]]:
        """Calls that compute the results of the blocks in turn, while cases to be compared with a second run are
        noted."""
        for first, outputs, fates in in_blocks(shards(pool)):
            again = np.flatnonzero((places >= first) & (places < first + len(outputs)))
            cases = places[again] - first
            before.append(outputs[cases])
            ended.update({int(k): fates[int(c)] for k, c in zip(again, cases, strict=True) if int(c) in fates})
            yield partial(block_results, first, outputs, fates)

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        for first, run, found_values in ahead(pool, calls(pool), AHEAD):
            writer.put_cases(number, first, found_values)
            outcomes.add_run(run)
            progress(first + len(run.case))
    if histories is not None:
        again = np.concatenate(before)
        first_kept = 0
        for start, read_shard in shards_in_order(folder, histories):
            # a case that gave nothing then has no history either: it is what was found of it first that counts
            lost = {case - start: fate for case, fate in ended.items() if 0 <= case - start < len(read_shard.outputs)}
            known = {**read_shard.fates, **lost}
            _check_bits(histories, start, read_shard.outputs, again[start : start + len(read_shard.outputs)], known)
            history_rows = np.array(
                [case in lost or case not in read_shard.fates for case in range(len(read_shard.outputs))]
            )
            if history_rows.any():
                run = _results(histories, start, read_shard.outputs, read_shard.history, known)
                writer.put_signals(number, first_kept, run, history_rows)
            first_kept += int(history_rows.sum())
    return outcomes


def without_history(folder: Folder, values: CampaignSection, histories: CampaignSection) -> dict[int, str]:
    """Rows whose worker died, or that did not end, when they were run again for their histories, with the reasons: they
    have no history. Rows with the same outcome the first time keep their empty one."""
    first = {row for row, _ in _alone(folder, values)}
    return {row: why for row, why in _alone(folder, histories) if row not in first}


def _alone(folder: Folder, section: CampaignSection) -> Iterator[tuple[int, str]]:
    """Rows that could not be run, with the reasons; each has a shard of its own. If an earlier shard has the row too,
    that counts, as in `shards_in_order`: a worker that was thought dead may have finished."""
    end = 0
    for task in folder.named_tasks(section.number):
        if task.cases == 1 and task.first >= end:
            with contextlib.suppress(UnsoundShard, OSError):  # `pieces` meets it, too
                for _, why in folder.read(section, task).fates.values():
                    yield int(section.rows[task.first]), why
        end = max(end, task.last)


def results(folder: Folder, section: CampaignSection, most: Mapping[str, int] | None = None) -> CaseOutcomes:
    """The outcomes of all cases of a section, by which histories are chosen. most: as for `CaseOutcomes`"""
    outcomes = CaseOutcomes(section.prepared.experiment, most)
    for start, read_shard in shards_in_order(folder, section):
        outcomes.add_run(_results(section, start, read_shard.outputs, None, dict(read_shard.fates)))
    return outcomes


def shards_in_order(
    folder: Folder, section: CampaignSection, pool: ThreadPoolExecutor | None = None
) -> Iterator[tuple[int, Shard]]:
    """The shards (files of tasks' results) of a section in order, without cases of earlier ones, each with the place of
    its first case. Raises Missing.

    pool  threads that read some in advance, unless they have histories, which would take much memory
    """

    def read(task: Task, end: int) -> tuple[int, Shard]:
        """A task's shard without cases before `end`, and `end`. Raises Missing."""
        try:
            read_shard = folder.read(section, task)
        except (UnsoundShard, OSError) as reason:
            raise Missing(f"shard {task.name} {reason}") from reason
        if end > task.first:
            read_shard = _part(read_shard, np.arange(end - task.first, task.cases), read_shard.key)
        return end, read_shard

    tasks, end = [], 0
    for task in folder.named_tasks(section.number):
        if task.last > end >= task.first:
            tasks.append(partial(read, task, end))
            end = task.last
    yield from ahead(None if section.recorded else pool, tasks, AHEAD)
    if end < len(section.rows):
        raise Missing(f"no shard holds case {end:,} of {section.name}")


def in_blocks(
    shards: Iterable[tuple[int, Shard]],
) -> Iterator[tuple[int, np.ndarray, dict[int, tuple[int, str]]]]:
    """Outputs and fates of cases in blocks of `BLOCK`, whatever the shards, each with the place of its first case."""
    waiting: list[np.ndarray] = []
    fates: dict[int, tuple[int, str]] = {}
    first = held = 0
    for start, read_shard in shards:
        fates |= {start - first + case: fate for case, fate in read_shard.fates.items()}
        waiting.append(
            read_shard.outputs.copy() if read_shard.history is not None else read_shard.outputs
        )  # not the shard with it
        held += len(read_shard.outputs)
        while held >= BLOCK:
            outputs = np.concatenate(waiting)
            yield first, outputs[:BLOCK], {case: fate for case, fate in fates.items() if case < BLOCK}
            fates = {case - BLOCK: fate for case, fate in fates.items() if case >= BLOCK}
            waiting, first, held = [outputs[BLOCK:]], first + BLOCK, held - BLOCK
    if held:
        yield first, np.concatenate(waiting), fates


def runs_in_blocks(folder: Folder, section: CampaignSection, threads: int | None = None) -> Iterator[tuple[int, Run]]:
    """The results of all cases of a section in order, in blocks of `BLOCK`, each with the place of its first case.
    Raises Missing."""

    def block_results(first: int, outputs: np.ndarray, fates: dict[int, tuple[int, str]]) -> tuple[int, Run]:
        return first, _results(section, first, outputs, None, fates)

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        blocks = (partial(block_results, *block) for block in in_blocks(shards_in_order(folder, section, pool)))
        yield from ahead(pool, blocks, AHEAD)


def ahead(pool: ThreadPoolExecutor | None, calls: Iterable[Callable[[], T]], most: int) -> Iterator[T]:
    """The results of these calls, in order; the threads of a pool compute at most `most` beyond the current one.
    Without a pool each is computed when it is taken."""
    waiting: deque[Future[T]] = deque()
    try:
        for call in calls:
            if pool is None:
                yield call()
                continue
            waiting.append(pool.submit(call))
            if len(waiting) > most:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        for future in waiting:
            future.cancel()


def with_rows(folder: Folder, section: CampaignSection, places: np.ndarray, number: int) -> CampaignSection:
    """A section of some of another's cases, with shards of its own under this number. places: rising. Raises
    Missing."""
    new_section = replace(section, number=number, rows=np.asarray(section.rows[places]), memories=None)
    for task in folder.named_tasks(number):
        (folder.shards / task.name).unlink(missing_ok=True)
    done = end = 0
    for task in folder.named_tasks(section.number):
        first, last = np.searchsorted(places, [max(task.first, end), task.last]).tolist()
        end = max(end, task.last)  # each case counts once
        if last <= first:
            continue
        try:
            read_shard = folder.read(section, task)
        except (UnsoundShard, OSError) as reason:
            raise Missing(f"shard {task.name} {reason}") from reason
        own = Task(number, first, last)
        part = _part(read_shard, places[first:last] - task.first, new_section.key(first, last))
        write_shard(folder.shards / own.name, part)
        done += last - first
    if done < len(places):
        raise Missing(f"{len(places) - done:,} cases of {section.name} have no shard any more")
    return new_section


def _part(original: Shard, cases: np.ndarray, key: str) -> Shard:
    """Some cases of a shard, by their places in it, as a new shard with this key, without computing time, which stays
    with the original."""
    history = None if original.history is None else original.history[cases]
    to = {case: place for place, case in enumerate(cases.tolist())}
    fates = {to[case]: fate for case, fate in original.fates.items() if case in to}
    return Shard(key, original.outputs[cases], history, 0.0, fates)


def _results(
    section: CampaignSection,
    first: int,
    outputs: np.ndarray,
    history: np.ndarray | None,
    fates: dict[int, tuple[int, str]],
) -> Run:
    """The results of the cases of a stretch, from the kernel's outputs. fates: cases that did not end, with the status
    and the reason."""
    return engine.results(section.prepared, section.rows[first : first + len(outputs)], history, outputs, fates)


def _check_bits(
    section: CampaignSection, start: int, now: np.ndarray, before: np.ndarray, fates: Iterable[int]
) -> None:
    """Check that a case run again for its history gave the same numbers; cases in `fates` gave none."""
    own = len(section.prepared.program.outputs)  # the last bits of linear answers depend on the processor
    now, before = np.ascontiguousarray(now[:, :own]), np.ascontiguousarray(before[:, :own])
    alike = ((now.view(np.int64) == before.view(np.int64)) | (np.isnan(now) & np.isnan(before))).all(axis=1)
    alike[list(fates)] = True
    if not alike.all():
        case = section.prepared.experiment.cases.table[section.rows[start + int(np.argmin(alike))]]
        message = f"case #{case} of `{section.name}` gave other numbers when it was run again for its history"
        raise Problem(error("E352", message, help="a defect of MET, or of this machine's memory: please report it"))
