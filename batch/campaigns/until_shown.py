"""Cases of design points in order, until the requirements with a confidence of each are decided (`until_shown`).

A design point stops at the first of its cases after which a test that may be looked at after every case
(met/statistics/sequential.py) has decided all of these requirements, or at its last. That depends only on its cases in
their order. The tasks' ends, their workers and the times of the tests decide how many cases are computed beyond it, and
these are dropped: they reach neither the archive nor a verdict.
"""

from __future__ import annotations

import numpy as np

from batch.campaigns import tasks
from batch.campaigns.drive import Driver, Stopped
from batch.campaigns.folder import Folder
from batch.campaigns.merge import with_rows
from batch.campaigns.tasks import GRANULE, CampaignSection, Task
from met import run as engine
from met.run import DONE
from met.statistics.design_points import design_points
from met.statistics.sequential import limits

FIRST_CASES = 256
"""Number of cases of a design point before its first test, unless fewer may decide it."""

GROWTH = 2
"""Divisor of a design point's cases that gives the number of further cases before the next test."""


class StoppingPoints:
    """The design points of a section, with their known cases and their stops."""

    def __init__(self, section: CampaignSection) -> None:
        """Number the design points of a section's cases; none of the cases is known yet."""
        experiment = section.prepared.experiment
        chosen = [
            coordinate.values[section.rows] for coordinate in experiment.cases.coordinates if not coordinate.design
        ]
        points = design_points(chosen, len(section.rows))
        ordered = np.argsort(points, kind="stable")
        self._section = section
        self._places = np.split(ordered, np.cumsum(np.bincount(points))[:-1])
        self._wanted = [requirement for requirement in experiment.requirements if requirement.confidence is not None]
        most = max(map(len, self._places))
        self._limits = [
            limits(requirement.share or 0.0, requirement.confidence or 0.0, most) for requirement in self._wanted
        ]
        self._read: dict[Task, np.ndarray] = {}
        self._known = np.zeros(len(section.rows), bool)
        self._missed = np.zeros((len(section.rows), len(self._wanted)), bool)
        self._failed = np.zeros(len(section.rows), bool)
        self._stops: list[int | None] = [None] * len(self._places)

    @property
    def count(self) -> int:
        """The number of design points."""
        return len(self._places)

    @property
    def decided(self) -> int:
        """The number of design points that have reached their stop."""
        return sum(stop is not None for stop in self._stops)

    @property
    def failed(self) -> int:
        """The number of failed cases among those known and not dropped."""
        known_places = [
            p[: self._prefix(p) if stop is None else stop] for p, stop in zip(self._places, self._stops, strict=True)
        ]
        return sum(int(self._failed[places].sum()) for places in known_places)

    def read(self, folder: Folder) -> None:
        """Read the shards so far; an unsound one counts as empty. A case counts once, as in merging."""
        self._known[:] = False
        for task in folder.named_tasks(self._section.number):
            if task not in self._read:
                try:
                    self._read[task] = self._outcomes(task, folder.read(self._section, task))
                except (tasks.UnsoundShard, OSError):
                    continue
            new = ~self._known[task.first : task.last]
            self._missed[task.first : task.last][new] = self._read[task][new, :-1]
            self._failed[task.first : task.last][new] = self._read[task][new, -1]
            self._known[task.first : task.last] = True
        self._stops = [self._stop(places) for places in self._places]

    def places_up_to_stops(self) -> np.ndarray:
        """Places in the section of the cases up to each design point's stop, ascending."""
        parts = [places[:stop] for places, stop in zip(self._places, self._stops, strict=True)]
        return np.sort(np.concatenate(parts))

    def next_batch(self, workers: int) -> list[tuple[int, int]]:
        """Stretches of cases to run next: for each undecided design point, its next unknown cases."""
        undecided = [places for places, stop in zip(self._places, self._stops, strict=True) if stop is None]
        busy = GRANULE * -(-2 * workers // max(1, len(undecided)))
        stretches: list[tuple[int, int]] = []
        for places in undecided:
            known = self._prefix(places)
            next_places = places[known : known + self._batch(places, known, busy)]
            next_places = np.sort(next_places[~self._known[next_places]])
            parts = np.split(next_places, np.flatnonzero(np.diff(next_places) > 1) + 1)
            stretches += [(int(part[0]), int(part[-1]) + 1) for part in parts]
        return sorted(stretches)

    def _batch(self, places: np.ndarray, known: int, busy: int) -> int:
        """The number of cases of a design point that are run before its next test, at least `busy`; one where cases are
        driven on motor beds."""
        if self._section.prepared.wire:
            return 1
        batch = max(busy, min(self._needed(places, known), max(FIRST_CASES, known // GROWTH)))
        return -(-batch // GRANULE) * GRANULE

    def _outcomes(self, task: Task, task_shard: tasks.Shard) -> np.ndarray:
        """For each case of a shard, whether it misses each of the requirements, by the archive's rule, and whether it
        failed: [case, requirement], the last for failed."""
        rows = self._section.rows[task.first : task.last]
        run = engine.results(self._section.prepared, rows, None, task_shard.outputs, dict(task_shard.fates))
        met = [
            run.met[requirement.text] & ~np.isnan(run.metrics[requirement.metric]) & (run.status == DONE)
            for requirement in self._wanted
        ]
        return ~np.stack([*met, run.status == DONE], axis=1)

    def _prefix(self, places: np.ndarray) -> int:
        """The number of a design point's first cases that are known."""
        known = self._known[places]
        return len(places) if known.all() else int(known.argmin())

    def _stop(self, places: np.ndarray) -> int | None:
        """The number of cases after which a design point stops, as all its requirements are decided; None where its
        known cases do not decide it."""
        known = self._prefix(places)
        cases, stop = np.arange(1, known + 1), 0
        for limit, missed in zip(self._limits, self._missed[places[:known]].T, strict=True):
            decided = limit.verdicts(cases, np.cumsum(missed)) != 0
            stop = max(stop, int(decided.argmax()) + 1 if decided.any() else known + 1)
        if stop <= known:
            return stop
        return known if known == len(places) else None

    def _needed(self, places: np.ndarray, known: int) -> int:
        """The fewest further cases that may decide all requirements of a design point."""
        most = 1
        for limit, missed in zip(self._limits, self._missed[places[:known]].T, strict=True):
            if not limit.verdicts(np.arange(1, known + 1), np.cumsum(missed)).any():
                misses = min(int(missed.sum()), len(limit.demonstrates) - 1)
                most = max(most, int(limit.demonstrates[misses]) - known)
        return most


def run_until_shown(driver: Driver, section: CampaignSection, points: StoppingPoints) -> None:
    """Run a section's cases until all of its design points have come to their stop. Raises Stopped.

    Of failures, those of cases that are dropped do not count.
    """
    count, before = driver.counts[section.number], list[tuple[int, int]]()
    with driver.telling(section, cases=0):
        while batch := points.next_batch(driver.executor.workers):
            if batch == before:
                raise Stopped(f"what is computed of {section.name} cannot be read back from {driver.folder.shards}")
            driver.more = f"{points.decided:,} of {points.count:,} design point{'s' * (points.count != 1)} decided"
            driver.work(section, batch, checked=False)
            points.read(driver.folder)
            count.failed = points.failed
            driver.check()
            before = batch


def without_dropped(folder: Folder, section: CampaignSection, points: StoppingPoints, number: int) -> CampaignSection:
    """The section without dropped cases, with shards of its own under this number. Raises Missing."""
    places = points.places_up_to_stops()
    return section if len(places) == len(section.rows) else with_rows(folder, section, places, number)
