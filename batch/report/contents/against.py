"""The other archive of a report's comparison: its matching cases, and their results there."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.differences.result import Diff, ExperimentDiff
from batch.queries.pool import ENDED, CaseColumn, Pool
from batch.queries.signals import deck_unit
from met.diagnostic import Problem
from met.frozen import frozen
from met.plan import Experiment

GOOD = (ENDED.index("met"), ENDED.index("done"))


@frozen
class ComparedArchive:
    """The other (earlier) archive, and the differences from it, in which both archives have the names of the page."""

    file: ArchiveFile
    differences: Diff

    def of(self, pool: Pool) -> EarlierCases | None:
        """The earlier archive's cases that match those of a run or sweep; None where that archive has no such run or
        sweep."""
        groups = {group.name: group for group in self.file.groups}
        by_name = {experiment.name_b: experiment for experiment in self.differences.experiments}
        pairs = [
            (number, groups[by_name[group.name].name_a], by_name[group.name])
            for number, group in enumerate(pool.groups)
            if group.name in by_name
        ]
        return EarlierCases(pool, pairs, self.file) if pairs else None


class EarlierCases:
    """The cases of the other archive that are those of a pool, in the pool's order.

    pool   theirs, of `file`
    pairs  of each structure in both: which of the first pool's it is, theirs, and how they differ
    place  [case] which case of `pool` it is, -1 where there is none;  how: its place in VERDICTS, likewise
    """

    def __init__(self, now: Pool, pairs: Sequence[tuple[int, ArchiveGroup, ExperimentDiff]], file: ArchiveFile) -> None:
        self.now, self.pairs, self.file = now, tuple(pairs), file
        self.pool = Pool(now.name, [group for _, group, _ in pairs])
        self.place = np.full(now.count, -1)
        self.how = np.full(now.count, -1, np.int8)
        for theirs, (number, _, experiment) in enumerate(pairs):
            mine = _places(now, number)[experiment.cases.b]
            self.place[mine] = _places(self.pool, theirs)[experiment.cases.a]
            self.how[mine] = experiment.how

    @cached_property
    def in_both(self) -> np.ndarray:
        """[case] whether it is in both."""
        return self.place >= 0

    @cached_property
    def ended(self) -> np.ndarray:
        """[case] its outcome before, as its place in `content.ENDED`; -1 where there is none."""
        return np.where(self.in_both, self.pool.ended[self.place], -1)

    @cached_property
    def most(self) -> tuple[int, ...]:
        """Numbers of the cases that differ most, the largest difference first."""
        ranked = [case_diff for _, _, experiment in self.pairs for case_diff in experiment.worst]
        return tuple(case_diff.case_b for case_diff in sorted(ranked, key=lambda case_diff: -case_diff.score))

    def experiments(self) -> dict[str, Experiment]:
        """The experiments of the other archive's plan, by name; none where the plan cannot be read here."""
        try:
            return {experiment.name: experiment for experiment in self.file.plan().experiments}
        except Problem:
            return {}

    def values(self, metric: CaseColumn) -> np.ndarray | None:
        """The earlier values of a metric, in its unit: [case], not-a-number where there is none; None where the earlier
        archive has no such metric in this unit."""
        name = metric.key.partition(":")[2]
        mine, theirs = (
            [
                group.variables[name]
                for group in pool.groups
                if name in group.variables and group.variables[name].role == "metric"
            ]
            for pool in (self.now, self.pool)
        )
        if not theirs or {metric.unit for metric in theirs} != {column.unit for column in mine}:
            return None
        before = self.pool.gathered(name) / deck_unit(mine[0])[0]
        return np.where(self.in_both, before[self.place], np.nan)

    def history_of(self, number: int, position: int) -> tuple[ArchiveGroup, int] | None:
        """The earlier archive's group and the position in it for a case of the structure `number`; None where it has no
        history of it."""
        for mine, group, experiment in self.pairs:
            if mine == number:
                matches = np.flatnonzero(experiment.cases.b == position)
                if (
                    len(matches)
                    and (former_position := int(experiment.cases.a[matches[0]])) in group.recorded_positions
                ):
                    return group, former_position
        return None


def _places(pool: Pool, number: int) -> np.ndarray:
    """For each position in the group of structure `number`, the place of that case among the cases of all
    structures."""
    places = np.flatnonzero(pool.group_of == number)
    out = np.empty(len(places), np.int64)
    out[pool.position_of[places]] = places
    return out


def change(column: CaseColumn) -> CaseColumn | None:
    """A metric less its former value; 0 where both are the same infinity. None where there are no former values."""
    before = column.before
    if before is None:
        return None
    with np.errstate(invalid="ignore"):
        values = np.where(column.values == before, 0.0, column.values - before)
    return CaseColumn(f"change:{column.key}", f"change of {column.label}", column.unit, "change", values)


def display_names(before: Path, now: Path) -> tuple[str, str]:
    """The names of two archives in a page: their files' names, or as much of their paths as distinguishes them."""
    former, two = before.absolute().parts, now.absolute().parts
    for length in range(1, max(len(former), len(two)) + 1):
        if former[-length:] != two[-length:]:
            return str(Path(*former[-length:])), str(Path(*two[-length:]))
    return before.name, now.name


def rename_archives(differences: Diff, before: str, now: str) -> Diff:
    """The same differences with these names for the two archives in all texts."""
    names = {str(differences.b): now, str(differences.a): before}
    either = re.compile("|".join(re.escape(path) for path in sorted(names, key=len, reverse=True)))

    def renamed(text: str) -> str:
        return either.sub(lambda match: names[match[0]], text)

    experiments = tuple(
        replace(
            experiment,
            signals=[replace(signal, why=renamed(signal.why)) for signal in experiment.signals],
            notes=[renamed(note) for note in experiment.notes],
        )
        for experiment in differences.experiments
    )
    return replace(differences, a=Path(before), b=Path(now), experiments=experiments)


def of_groups(differences: Diff, groups: Sequence[ArchiveGroup]) -> Diff:
    """The differences restricted to these runs and sweeps of the second archive."""
    names = {group.name for group in groups}
    experiments = tuple(experiment for experiment in differences.experiments if experiment.name_b in names)
    only_b = tuple(name for name in differences.only_b if name in names)
    return replace(differences, experiments=experiments, only_a=(), only_b=only_b)
