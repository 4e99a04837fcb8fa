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

from batch.campaigns import shard
from batch.campaigns.folder import Folder
from batch.campaigns.outcomes import CaseOutcomes
from batch.campaigns.tasks import CampaignSection, Task
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
    progress: Callable[[int], None] = lambda _: None,
    *,
    threads: int | None = None,
) -> CaseOutcomes:
    """Write one experiment; returns the outcomes of its cases. Raises Missing.

    values     all of its cases;  histories: those that were run again for them
    progress   told how many cases are written
    threads    that read shards and make what is written; None: one a processor
    """
    kept = histories.rows if histories is not None else np.empty(0, np.int64)
    places = places_among(values.rows, np.asarray(kept))
    outcomes = CaseOutcomes(values.prepared.experiment)
    before: list[np.ndarray] = []
    ended: dict[int, tuple[int, str]] = {}

    def made(first: int, outputs: np.ndarray, fates: dict[int, tuple[int, str]]) -> tuple[int, Run, Mapping[str, Any]]:
        run = _results(values, first, outputs, None, fates)
        return first, run, writer.case_values(number, run)

    def shards(pool: ThreadPoolExecutor) -> Iterator[tuple[int, shard.Shard]]:
        for at, found in shards_in_order(folder, values, pool):
            if found.history is not None:
                run = _results(values, at, found.outputs.copy(), found.history, dict(found.fates))
                writer.put_signals(number, at, run)
            yield at, found

    def calls(pool: ThreadPoolExecutor) -> Iterator[Callable[[], tuple[int, Run, Mapping[str, Any]]]]:
        for first, outputs, fates in in_blocks(shards(pool)):
            again = np.flatnonzero((places >= first) & (places < first + len(outputs)))
            here = places[again] - first
            before.append(outputs[here])
            ended.update({int(k): fates[int(c)] for k, c in zip(again, here, strict=True) if int(c) in fates})
            yield partial(made, first, outputs, fates)

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        for first, run, found_values in ahead(pool, calls(pool), AHEAD):
            writer.put_cases(number, first, found_values)
            outcomes.add_run(run)
            progress(first + len(run.case))
    if histories is not None:
        again = np.concatenate(before)
        first_kept = 0
        for at, found in shards_in_order(folder, histories):
            # a case that gave nothing then has no history either: it is what was found of it first that counts
            lost = {case - at: fate for case, fate in ended.items() if 0 <= case - at < len(found.outputs)}
            known = {**found.fates, **lost}
            _check_bits(histories, at, found.outputs, again[at : at + len(found.outputs)], known)
            kept = np.array([case in lost or case not in found.fates for case in range(len(found.outputs))])
            if kept.any():
                run = _results(histories, at, found.outputs, found.history, known)
                writer.put_signals(number, first_kept, run, kept)
            first_kept += int(kept.sum())
    return outcomes


def without_history(folder: Folder, values: CampaignSection, histories: CampaignSection) -> dict[int, str]:
    """Rows whose worker died, or that did not end, when they were run again for their histories, with the reasons: they
    have no history. Rows with the same outcome the first time keep their empty one."""
    first = {row for row, _ in _alone(folder, values)}
    return {row: why for row, why in _alone(folder, histories) if row not in first}


def _alone(folder: Folder, section: CampaignSection) -> Iterator[tuple[int, str]]:
    """Rows that could not be run, with the reasons; each has a shard of its own. If an earlier shard has the row too,
    that counts, as in `shards_in_order`: a worker that was thought dead may have finished."""
    at = 0
    for task in folder.named_tasks(section.number):
        if task.cases == 1 and task.first >= at:
            with contextlib.suppress(shard.UnsoundShard, OSError):  # `pieces` meets it, too
                for _, why in folder.read(section, task).fates.values():
                    yield int(section.rows[task.first]), why
        at = max(at, task.last)


def results(folder: Folder, section: CampaignSection, most: Mapping[str, int] | None = None) -> CaseOutcomes:
    """The outcomes of all cases of a section, by which histories are chosen. most: as for `CaseOutcomes`"""
    outcomes = CaseOutcomes(section.prepared.experiment, most)
    for at, found in shards_in_order(folder, section):
        outcomes.add_run(_results(section, at, found.outputs, None, dict(found.fates)))
    return outcomes


def shards_in_order(
    folder: Folder, section: CampaignSection, pool: ThreadPoolExecutor | None = None
) -> Iterator[tuple[int, shard.Shard]]:
    """The shards of a section in order, without cases of earlier ones, each with the place of its first case. pool:
    reads some in advance, unless they have histories, which would take much memory. Raises Missing."""

    def read(task: Task, at: int) -> tuple[int, shard.Shard]:
        try:
            return at, _without(folder.read(section, task), at - task.first)
        except (shard.UnsoundShard, OSError) as reason:
            raise Missing(f"shard {task.name} {reason}") from reason

    tasks, at = [], 0
    for task in folder.named_tasks(section.number):
        if task.last > at >= task.first:
            tasks.append(partial(read, task, at))
            at = task.last
    yield from ahead(None if section.recorded else pool, tasks, AHEAD)
    if at < len(section.rows):
        raise Missing(f"no shard holds case {at:,} of {section.name}")


def in_blocks(
    shards: Iterable[tuple[int, shard.Shard]],
) -> Iterator[tuple[int, np.ndarray, dict[int, tuple[int, str]]]]:
    """Outputs and fates of cases in blocks of `BLOCK`, whatever the shards, each with the place of its first case."""
    waiting: list[np.ndarray] = []
    fates: dict[int, tuple[int, str]] = {}
    first = held = 0
    for at, found in shards:
        fates |= {at - first + case: fate for case, fate in found.fates.items()}
        waiting.append(found.outputs.copy() if found.history is not None else found.outputs)  # not the shard with it
        held += len(found.outputs)
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

    def made(first: int, outputs: np.ndarray, fates: dict[int, tuple[int, str]]) -> tuple[int, Run]:
        return first, _results(section, first, outputs, None, fates)

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        blocks = (partial(made, *block) for block in in_blocks(shards_in_order(folder, section, pool)))
        yield from ahead(pool, blocks, AHEAD)


def ahead(pool: ThreadPoolExecutor | None, calls: Iterable[Callable[[], T]], most: int) -> Iterator[T]:
    """The results of these calls, in order, computed by a pool of threads, at most `most` beyond the current one;
    without a pool, each on request."""
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
        for each in waiting:
            each.cancel()


def with_rows(folder: Folder, section: CampaignSection, places: np.ndarray, number: int) -> CampaignSection:
    """A section of some of another's cases, with shards of its own under this number. places: rising. Raises
    Missing."""
    kept = replace(section, number=number, rows=np.asarray(section.rows[places]), memories=None)
    for task in folder.named_tasks(number):
        (folder.shards / task.name).unlink(missing_ok=True)
    done = at = 0
    for task in folder.named_tasks(section.number):
        first, last = np.searchsorted(places, [max(task.first, at), task.last]).tolist()
        at = max(at, task.last)  # each case counts once
        if last <= first:
            continue
        try:
            found = folder.read(section, task)
        except (shard.UnsoundShard, OSError) as reason:
            raise Missing(f"shard {task.name} {reason}") from reason
        own = Task(number, first, last)
        part = _part(found, places[first:last] - task.first, kept.key(first, last))
        shard.write(folder.shards / own.name, part)
        done += last - first
    if done < len(places):
        raise Missing(f"{len(places) - done:,} cases of {section.name} have no shard any more")
    return kept


def _part(found: shard.Shard, cases: np.ndarray, key: str) -> shard.Shard:
    """Some cases of a shard as a new shard, without computing time, which stays with the original."""
    history = None if found.history is None else found.history[cases]
    to = {case: place for place, case in enumerate(cases.tolist())}
    fates = {to[case]: fate for case, fate in found.fates.items() if case in to}
    return shard.Shard(key, found.outputs[cases], history, 0.0, fates)


def _without(found: shard.Shard, first: int) -> shard.Shard:
    """A shard without its first cases."""
    if not first:
        return found
    history = None if found.history is None else found.history[first:]
    fates = {case - first: fate for case, fate in found.fates.items() if case >= first}
    return shard.Shard(found.key, found.outputs[first:], history, found.seconds, fates)


def _results(
    section: CampaignSection,
    first: int,
    outputs: np.ndarray,
    history: np.ndarray | None,
    fates: dict[int, tuple[int, str]],
) -> Run:
    rows = section.rows[first : first + len(outputs)]
    return engine.results(section.prepared, rows, history, outputs, fates)


def _check_bits(section: CampaignSection, at: int, now: np.ndarray, before: np.ndarray, fates: Iterable[int]) -> None:
    """Check that a case run again for its history gave the same numbers; cases in `fates` gave none."""
    own = len(section.prepared.program.outputs)  # the last bits of linear answers depend on the processor
    now, before = np.ascontiguousarray(now[:, :own]), np.ascontiguousarray(before[:, :own])
    alike = ((now.view(np.int64) == before.view(np.int64)) | (np.isnan(now) & np.isnan(before))).all(axis=1)
    alike[list(fates)] = True
    if not alike.all():
        case = section.prepared.experiment.cases.table[section.rows[at + int(np.argmin(alike))]]
        message = f"case #{case} of `{section.name}` gave other numbers when it was run again for its history"
        raise Problem(error("E352", message, help="a defect of MET, or of this machine's memory: please report it"))
