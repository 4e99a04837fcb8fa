"""Statistics of very many cases, block by block: counts, moments, extremes and order statistics, for archives that keep
a summary, and for those with more rows than fit in memory.

`CaseTallies` adds the blocks up; `summed_up` gives the summary of an archive's group, made from its rows where it keeps
none. Blocks are of one size and come in order, and sums are exact: so results do not depend on how the cases were run.
Memory grows with the design points, and with the cases beyond a bounded percentile.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any, Protocol

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.archive.stored import Stored
from batch.archive.summarised import DOUBTFUL, VARIABLES, WORDS, CaseSummary
from batch.queries.pool import NUMBER
from batch.queries.requirements import beyond, group_requirements, requirement_texts
from met.frozen import frozen
from met.plan.columns import blocks
from met.run import DONE
from met.statistics.confidence import percentile_rank
from met.statistics.moments import Furthest, Moments

MOST_POINTS = 10_000
"""Largest number of design points, since each has rows of its own."""

MOST_CAUSES = 1000
"""Largest number of distinguished causes of failures; further ones are counted together."""

OTHERS = "other causes"


class TooManyPoints(Exception):
    """Raised where there are more than `MOST_POINTS` design points."""


class PointNumbers:
    """Design points, numbered in the order in which they first appear. values: the chosen values at each"""

    def __init__(self) -> None:
        self.values: list[tuple[float, ...]] = []
        self._numbers: dict[tuple[float, ...], int] = {}

    def of(self, chosen: Sequence[np.ndarray], cases: int) -> np.ndarray:
        """The design point of each of `cases` cases. chosen: arrays of a value a case; with none there is one design
        point. Raises TooManyPoints."""
        if not chosen:
            return np.full(cases, self._number(()))
        table = np.stack([np.asarray(column, float) for column in chosen], axis=1)
        _, first, index = np.unique(table, axis=0, return_index=True, return_inverse=True)
        numbers = np.empty(len(first), np.int64)
        for place in np.argsort(first).tolist():
            numbers[place] = self._number(tuple(table[first[place]].tolist()))
        return np.asarray(numbers[index.ravel()])

    def _number(self, values: tuple[float, ...]) -> int:
        """The number of a design point. Raises TooManyPoints."""
        if values not in self._numbers:
            if len(self.values) == MOST_POINTS:
                raise TooManyPoints
            self._numbers[values] = len(self.values)
            self.values.append(values)
        return self._numbers[values]


class RequiredOfCases(Protocol):
    """A requirement, of a plan or of an archive: the limit in SI, the share of cases and the confidence."""

    @property
    def metric(self) -> str:
        """The name of the metric that is judged."""

    @property
    def comparison(self) -> str:
        """The comparison of the metric with the limit: `<`, `<=`, `>` or `>=`."""

    @property
    def limit(self) -> float:
        """The limit of the metric, in SI."""

    @property
    def share(self) -> float | None:
        """The share of cases that must meet it; None: all."""

    @property
    def confidence(self) -> float | None:
        """The confidence with which that share is to be shown; None: it is counted."""


@frozen
class CaseBlock:
    """Some cases, in order. places: among all;  outcomes: [case, requirement] 1 met, 0 missed, -1 unknown;  points:
    their design points;  limited: how many had the load motor of a bed at its limit."""

    places: np.ndarray
    status: np.ndarray
    cause: Sequence[str]
    warning: Sequence[str]
    metrics: Mapping[str, np.ndarray]
    outcomes: np.ndarray
    points: np.ndarray
    limited: int


class Judged:
    """A requirement's row: counts, the worst case, moments and the bound. most: number of values nearest to the limit
    or beyond it, of which the last bounds the percentile; 0 where there is no bound"""

    def __init__(self, requirement: RequiredOfCases, most: int) -> None:
        self.requirement = requirement
        self.below = requirement.comparison.startswith("<")
        self.cases = self.missed = self.unknown = self.no_value = 0
        self.worst, self.worst_far, self.worst_value = -1, -math.inf, math.nan
        self.moments, self.furthest = Moments(), Furthest(most)

    def add(self, places: np.ndarray, values: np.ndarray, outcomes: np.ndarray, done: np.ndarray) -> None:
        """Add cases at these places. outcomes: 1 met, 0 missed, -1 unknown; done: a truth for each that reached its
        end"""
        unknown = outcomes == -1
        self.cases += len(places)
        self.missed += int(np.count_nonzero(outcomes == 0))
        self.unknown += int(np.count_nonzero(unknown))
        self.no_value += int(np.count_nonzero(unknown & done))
        limit = self.requirement.limit
        far = np.where(unknown, np.inf, beyond(values, self.requirement.comparison, limit) if limit else
                       (values if self.below else -values))  # fmt: skip
        place = int(np.argmax(far))
        if self.worst < 0 or far[place] > self.worst_far:
            self.worst, self.worst_far, self.worst_value = int(places[place]), float(far[place]), float(values[place])
        self.moments.add(values)
        self.furthest.add(np.where(unknown, np.inf, values if self.below else -values))

    def row(self, number: int, point: int) -> dict[str, Any]:
        """The row by the variables of the archive, without `judged_`; the worst case by its place."""
        bound = self.furthest.least
        return {
            "requirement": number, "point": point, "cases": self.cases, "missed": self.missed, "unknown": self.unknown,
            "no_value": self.no_value, "worst_case": self.worst, "worst": self.worst_value, "mean": self.moments.mean,
            "deviation": math.sqrt(self.moments.variance), "bound": bound if self.below else -bound,
        }  # fmt: skip


@frozen
class MetricTally:
    """Counts, moments and extremes of a metric: places and values of the least and the largest finite one."""

    moments: Moments = field(default_factory=Moments)
    counts: dict[str, int] = field(default_factory=lambda: {"infinite": 0, "unknown": 0})
    ends: dict[str, tuple[int, float]] = field(default_factory=dict)

    def add(self, places: np.ndarray, values: np.ndarray) -> None:
        """Add the values of cases at these places."""
        self.moments.add(values)
        self.counts["infinite"] += int(np.count_nonzero(np.isinf(values)))
        self.counts["unknown"] += int(np.count_nonzero(np.isnan(values)))
        finite = np.isfinite(values)
        if finite.any():
            for name, sign in (("least", 1.0), ("most", -1.0)):
                place = int(np.argmin(np.where(finite, sign * values, np.inf)))
                if name not in self.ends or sign * values[place] < sign * self.ends[name][1]:
                    self.ends[name] = int(places[place]), float(values[place])


class CaseTallies:
    """Counts, moments and extremes of all cases. metrics: by name; sizes: number of cases of each design point"""

    def __init__(
        self, metrics: Sequence[str], requirements: Sequence[RequiredOfCases], sizes: Sequence[int] | np.ndarray
    ) -> None:
        """Begin with no case. Of a requirement over a share of cases each design point has a tally of its own."""
        self._requirements = tuple(requirements)
        self.metrics = {name: MetricTally() for name in metrics}
        self._everywhere = [Judged(requirement, 0) for requirement in requirements]
        self._at_points = {
            number: [Judged(requirement, _most(requirement, int(size))) for size in sizes]
            for number, requirement in enumerate(requirements)
            if requirement.share is not None
        }
        self._causes: dict[tuple[int, str], list[Any]] = {}
        self.limited = 0

    def add(self, block: CaseBlock) -> None:
        """Add the next cases to the tallies of metrics, requirements and causes of failure."""
        self.limited += block.limited
        done = block.status == DONE
        for name, tally in self.metrics.items():
            tally.add(block.places, block.metrics[name])
        order = np.argsort(block.points, kind="stable") if self._at_points else np.zeros(0, np.int64)
        parts = np.split(order, np.flatnonzero(np.diff(block.points[order])) + 1) if len(order) else []
        for number, requirement in enumerate(self._requirements):
            values, met = block.metrics[requirement.metric], block.outcomes[:, number]
            self._everywhere[number].add(block.places, values, met, done)
            for part in parts if number in self._at_points else ():
                tally_at_point = self._at_points[number][int(block.points[part[0]])]
                tally_at_point.add(block.places[part], values[part], met[part], done[part])
        for place in np.flatnonzero(~done | np.array([word != "" for word in block.warning])).tolist():
            status = DOUBTFUL if done[place] else int(block.status[place])
            text = str(block.warning[place] if done[place] else block.cause[place])
            alike = (status, NUMBER.sub("#", text))
            if len(self._causes) >= MOST_CAUSES and alike not in self._causes:
                alike, text = (status, OTHERS), OTHERS
            self._causes.setdefault(alike, [0, int(block.places[place]), text])[0] += 1

    def named(self) -> list[int]:
        """Places of the cases that stand out: extremes of metrics, worst by requirements, first of causes."""
        places = [place for tally in self.metrics.values() for place, _ in tally.ends.values()]
        places += [row["worst_case"] for row in self._rows()]
        return places + [place for _, place, _ in self._causes.values()]

    def _rows(self) -> list[dict[str, Any]]:
        rows = [tally.row(number, -1) for number, tally in enumerate(self._everywhere)]
        for number, some in self._at_points.items():
            rows += [tally.row(number, point) for point, tally in enumerate(some)]
        return rows

    def values(
        self, case: Callable[[int], int], names: Mapping[str, str], chosen: Sequence[str], points: PointNumbers
    ) -> dict[str, np.ndarray]:
        """The variables of an archive's summary. case: the position in the case table of a place; names: of the
        metrics' variables; chosen: of those of what is chosen."""
        tallies, rows = list(self.metrics.values()), self._rows()
        ends = {name: [tally.ends.get(name, (-1, math.nan)) for tally in tallies] for name in ("least", "most")}
        values: dict[str, Any] = {
            "cause": [text for _, _, text in self._causes.values()],
            "cause_status": [status for status, _ in self._causes],
            "cause_cases": [count for count, _, _ in self._causes.values()],
            "cause_first": [case(place) for _, place, _ in self._causes.values()],
            "summed_metric": [names[name] for name in self.metrics],
            "finite": [tally.moments.count for tally in tallies],
            "infinite": [tally.counts["infinite"] for tally in tallies],
            "unknown": [tally.counts["unknown"] for tally in tallies],
            "mean": [tally.moments.mean for tally in tallies],
            "variance": [tally.moments.variance for tally in tallies],
            **{name: [value for _, value in extremes] for name, extremes in ends.items()},
            **{
                f"{name}_case": [case(place) if place >= 0 else -1 for place, _ in extremes]
                for name, extremes in ends.items()
            },
            "point": list(range(len(points.values))),
            "chosen": list(chosen),
            "chosen_value": np.array(points.values, float).reshape(len(points.values), len(chosen)),
            "judged": list(range(len(rows))),
            **{name: [row[name.removeprefix("judged_")] for row in rows] for name in VARIABLES if "judged_" in name},
            "judged_worst_case": [case(row["worst_case"]) for row in rows],
        }
        return {
            name: np.array(values[name], dtype=object if kind == WORDS else kind)
            for name, (_, kind, _) in VARIABLES.items()
        }


def _most(requirement: RequiredOfCases, cases: int) -> int:
    """The number of values nearest to the limit, or beyond it, among this many cases, of which the last bounds the
    percentile."""
    if requirement.share is None or requirement.confidence is None:
        return 0
    rank = percentile_rank(cases, requirement.share, requirement.confidence)
    return cases - rank + 1 if rank else 0


# An archive's rows

MANY = 4_000_000
"""Number of rows of a run or sweep from which they are processed in blocks: with fewer, medians and an order of all are
worth half a gigabyte of memory."""

STREAMED = "streamed"
"""The word of a summary that is not stored in an archive."""


def is_streamed(group: ArchiveGroup) -> bool:
    """True where a group has a row for each case, and too many for memory."""
    return group.summary is None and group.count > MANY and not group.attributes.get("until_shown")


def summed_up(group: ArchiveGroup) -> CaseSummary | None:
    """The summary of all cases; None where their rows fit in memory, or counts alone do not suffice: for cases that
    stop by their results, and with very many design points."""
    if group.summary is None and group.summed is None and is_streamed(group):
        group.summed = _of_rows(group)
    return group.summary or group.summed


def _of_rows(group: ArchiveGroup) -> CaseSummary | None:
    """The summary of a group's rows, read in blocks; None for an older archive, or too many design points."""
    required = group_requirements(group)
    if len(required) < len(requirement_texts(group)):  # an older archive, which lacks parts of some
        return None
    coordinates = group.role("coordinate")
    stretches = blocks(group.count) if "repeat" in group.variables else ()
    repeats = any(group.stretch("repeat", piece.start, piece.stop).any() for piece in stretches)
    drawn = any(variable.attributes.get("design") for variable in coordinates) or repeats
    chosen = [coordinate for coordinate in coordinates if not coordinate.attributes.get("design")] if drawn else []
    try:
        sizes = _sizes(group, chosen)
        points = PointNumbers()
        tallies = CaseTallies([variable.name for variable in group.role("metric")], required, sizes)
        for piece in blocks(group.count):
            tallies.add(_block(group, piece, chosen, points))
    except TooManyPoints:
        return None
    values = tallies.values(
        lambda place: int(group.at("case", [place])[0]),
        {name: name for name in tallies.metrics},
        [variable.name for variable in chosen],
        points,
    )
    return CaseSummary(group.count, tallies.limited, STREAMED, drawn, values)


def _sizes(group: ArchiveGroup, chosen: list[Stored]) -> list[int]:
    """The number of cases of each design point."""
    if not chosen:
        return [group.count]
    points, sizes = PointNumbers(), np.zeros(MOST_POINTS, np.int64)
    for piece in blocks(group.count):
        sizes += np.bincount(_points(group, piece, chosen, points), minlength=len(sizes))
    return sizes[: len(points.values)].tolist()


def _points(group: ArchiveGroup, piece: slice, chosen: list[Stored], points: PointNumbers) -> np.ndarray:
    stretches = [group.stretch(variable.name, piece.start, piece.stop) for variable in chosen]
    return points.of(stretches, piece.stop - piece.start)


def _block(group: ArchiveGroup, piece: slice, chosen: list[Stored], points: PointNumbers) -> CaseBlock:
    """The outcomes and metrics of a stretch of a group's rows, with the design point of each."""

    def read(name: str) -> np.ndarray:
        return group.stretch(name, piece.start, piece.stop)

    count = piece.stop - piece.start
    return CaseBlock(
        np.arange(piece.start, piece.stop),
        read("status"),
        read("cause").tolist(),
        read("warning").tolist() if "warning" in group.variables else [""] * count,
        {variable.name: read(variable.name) for variable in group.role("metric")},
        read("met") if "met" in group.variables else np.zeros((count, 0), np.int8),
        _points(group, piece, chosen, points),
        int(np.count_nonzero(read("bed_limited"))) if "bed_limited" in group.variables else 0,
    )
