"""Outcomes of an experiment's cases, collected as they come in nearly constant memory: finished cases, and the worst by
each metric. They decide which cases are run again, and how."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from met.frozen import frozen
from met.plan import Experiment
from met.plan.columns import RowBits
from met.run import DONE, Run

FEW = 1 << 17
"""Largest number of cases for which all values of metrics are kept."""


@frozen
class CountedCases:
    """Counts of an experiment's cases: all, failed ones, those with histories; and by the text of each requirement
    those that meet it, miss it, leave it open, and of these those that reached their end."""

    cases: int
    failed: int
    recorded: int
    met: Mapping[str, tuple[int, int, int, int]]


class CaseOutcomes:
    """Outcomes of the cases of an experiment, added in the order of the table.

    most  how many of the worst are wanted, by metric; one of each metric is known in any case
    """

    def __init__(self, experiment: Experiment, most: Mapping[str, int] | None = None) -> None:
        self._experiment, self._most = experiment, dict(most or {})
        self.count = 0
        self._packed: list[np.ndarray] = []
        self._left = np.zeros(0, bool)
        self._met: dict[str, Any] = {}
        self._worst: dict[str, _Worst] = {}
        self._finite: dict[str, _Worst] = {}
        self._values: dict[str, list[np.ndarray]] = {}

    def add(self, status: np.ndarray, metrics: Mapping[str, np.ndarray]) -> None:
        """Take the next cases: their status, and their metrics by name."""
        flags = np.concatenate([self._left, status == DONE])
        whole = len(flags) // 8 * 8
        self._packed.append(np.packbits(flags[:whole]))
        self._left = flags[whole:]
        few = self.count + len(status) <= FEW
        for name, values in metrics.items():
            if few:
                self._values.setdefault(name, []).append(np.where(status == DONE, values, np.nan))
            if name not in self._worst:
                bad = sign(self._experiment, name)
                self._worst[name], self._finite[name] = _Worst(bad, self._most.get(name, 1)), _Worst(bad, 1)
            self._worst[name].add(values, self.count)
            self._finite[name].add(np.where(np.isfinite(values), values, np.nan), self.count)
        if not few:
            self._values.clear()
        self.count += len(status)

    def add_run(self, run: Run) -> None:
        """Count the requirements that the next cases meet, miss, and leave open."""
        self.add(run.status, run.metrics)
        for requirement in self._experiment.requirements:
            value = ~np.isnan(run.metrics[requirement.metric])
            known = (run.status == DONE) & value
            counts = np.array(
                [
                    np.count_nonzero(known & run.met[requirement.text]),
                    np.count_nonzero(known & ~run.met[requirement.text]),
                    np.count_nonzero(~known),
                    np.count_nonzero((run.status == DONE) & ~value),
                ]
            )
            self._met[requirement.text] = self._met.get(requirement.text, 0) + counts

    def counted(self, recorded: int) -> CountedCases:
        """The number of cases of each kind. recorded: number of cases with histories"""
        met = {text: (int(a), int(b), int(c), int(d)) for text, (a, b, c, d) in self._met.items()}
        return CountedCases(self.count, self.count - self.done.set, recorded, met)

    @cached_property
    def done(self) -> RowBits:
        """Places of the cases that reached their end, once all have been added."""
        return RowBits(np.concatenate([*self._packed, np.packbits(self._left)]), self.count)

    @cached_property
    def failed(self) -> RowBits:
        """Places of the cases that failed."""
        return RowBits(~self.done.packed, self.count)

    def ends(self) -> tuple[int, int] | None:
        """Places of the first and the last case that reached their end; None where none did."""
        if not self.done.set:
            return None
        first, last = self.done.select(np.array([0, self.done.set - 1])).tolist()
        return first, last

    def few_values(self) -> list[np.ndarray]:
        """All values of each metric, [case], not-a-number where a case failed; empty where there are more than `FEW`
        cases."""
        return [np.concatenate(parts) for parts in self._values.values()] if self.count <= FEW else []

    def worst(self, metric: str) -> np.ndarray:
        """Places of the worst cases by a metric, worst first, among those with a value: as many as were wanted."""
        return self._worst[metric].places if metric in self._worst else np.zeros(0, np.int64)

    def worst_finite(self) -> list[int]:
        """Places of the worst by each metric among those with a finite value."""
        return [int(place) for worst in self._finite.values() for place in worst.places]


class _Worst:
    """The worst values so far, worst first; of equal ones the first. sign: -1 where small values are bad."""

    def __init__(self, sign: float, most: int) -> None:
        self._sign, self._most = sign, most
        self._bad, self.places = np.zeros(0), np.zeros(0, np.int64)

    def add(self, values: np.ndarray, first: int) -> None:
        """Take the next values, [case], and keep the places of the worst. first: the place of the first"""
        bad = self._sign * values
        some = np.flatnonzero(~np.isnan(bad))
        if len(self._bad) == self._most:
            some = some[bad[some] > self._bad[-1]]
        if len(some):
            both = np.concatenate([self._bad, bad[some]])
            order = np.argsort(-both, kind="stable")[: self._most]
            self._bad, self.places = both[order], np.concatenate([self.places, first + some])[order]


def sign(experiment: Experiment, metric: str) -> float:
    """1 where large values of a metric are bad; -1 where its first requirement sets a lower limit."""
    limits = [r.comparison for r in experiment.requirements if r.metric == metric]
    return -1.0 if limits and limits[0].startswith(">") else 1.0
