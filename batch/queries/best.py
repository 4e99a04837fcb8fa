"""The choice among the designs of a sweep: the chosen parameters, judged under all others.

A design is a combination of the values of what a sweep chooses: `vary`, `zip`, `from`. Its cases differ in what it must
withstand: drawn parameters, repeats, and those that the user names. It is good if it meets all requirements in them: a
requirement over a share of cases in that share of its own. The robustness of a good design is counted in steps of the
sweep's grid to the border, where a design is not good or the sweep ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from batch.queries import requirements
from batch.queries.evidence import ROUNDING
from batch.queries.expressions import CaseExpressions
from batch.queries.grids import FULL, levels
from batch.queries.pool import CaseColumn, Pool
from met.diagnostic import Problem, did_you_mean, error
from met.distinct import distinct
from met.frozen import frozen
from met.run import DONE
from met.statistics.design_points import design_points, in_step
from met.units import Dimension

MOST_CELLS = 1 << 26
"""Largest number of cells of a grid of designs; with more the border is not computed."""

BORNE = ("links.", "payloads.", "environment.", "initial.")
"""Prefixes of the paths of loads that servos must withstand, and a tuner does not choose, unless the user says so."""

ENDS, FAILS, UNKNOWN = "the sweep ends", "a case fails", "it was not run"


@frozen
class DesignAxis:
    """Parameters that are chosen as one: a choice, a parameter, or several that go in step.

    columns  of these, in the deck's units;  values: of the first, rising
    level    of each design, its place in `values`
    """

    columns: tuple[CaseColumn, ...]
    values: np.ndarray
    level: np.ndarray

    @property
    def ordered(self) -> bool:
        """True if its values are numbers, so that there is a next one."""
        return self.columns[0].role != "choice"


@frozen
class Stretch:
    """The range of a design along an axis, all else unchanged: the levels of the first and the last good design, and
    the obstacles on either side, in words."""

    first: int
    last: int
    below: str
    above: str


@frozen
class Goal:
    """A number that is to be least, or largest: a metric, or an expression of metrics and parameters.

    text    as it was asked for;  largest: whether it is to be that
    values  of each case, SI;  dimension: theirs
    """

    text: str
    largest: bool
    values: np.ndarray
    dimension: Dimension


class Designs:
    """The designs of a pool of cases.

    over    what they are held against besides what is drawn, repeated, or of links, payloads, the environment or the
            start, by path
    choose  what is chosen all the same of these

    Raises Problem E394 for a path that varies in no case, E395 where nothing is chosen.
    """

    def __init__(self, pool: Pool, over: Sequence[str] = (), choose: Sequence[str] = ()) -> None:
        """Number the designs of the cases: equal values of what is chosen are one design. Raises Problem E394, E395."""
        self.pool = pool
        varied = varied_columns(pool)
        check_varied(pool, (*over, *choose))
        borne = {variable.path for variable in pool.variables("coordinate") if variable.attributes.get("design")}
        _check_chosen([column.label for column in varied if column.label in borne], choose)
        self.draws = bool(borne - {*choose})
        """True if a parameter is drawn that a design must withstand."""
        borne = ({*borne, *(column.label for column in varied if column.label.startswith(BORNE))} - {*choose}) | {*over}
        chosen = [column for column in varied if column.label not in borne]
        self.against = tuple(column for column in varied if column.label in borne)
        """The parameters under which designs are judged."""
        if not chosen:
            names = ", ".join(column.label for column in varied)
            why = f"it must bear {names}" if names else "nothing varies"
            message = f"`{pool.name}` has no designs to choose among: {why}"
            helps = ["`vary PATH = [...];` in a sweep chooses values"]
            helps += ["`--choose PATH` says that one of these is chosen"] if names else []
            raise Problem(error("E395", message, help=helps))
        self.of_case = design_points([column.values for column in chosen], pool.count)
        """[case] the case's design."""
        self.first = np.unique(self.of_case, return_index=True)[1]
        """[design] the design's first case."""
        self.cases = np.bincount(self.of_case)
        """[design] the number of its cases."""
        self.axes = tuple(self._axis([chosen[i] for i in part]) for part in in_step([c.values for c in chosen]))

    @property
    def count(self) -> int:
        return len(self.first)

    def _axis(self, columns: Sequence[CaseColumn]) -> DesignAxis:
        own = columns[0].values[self.first]
        axis_levels = levels(own)
        return DesignAxis(tuple(columns), axis_levels, np.searchsorted(axis_levels, own))

    @cached_property
    def demands(self) -> tuple[str, ...]:
        """The demands on a good design: the requirements; of a sweep that has none, that its cases reach their end."""
        return self.pool.requirements or (FAILS,)

    @cached_property
    def shares(self) -> np.ndarray:
        """The share of a design's cases that must meet each demand, [demand]."""
        known = {
            group_requirement.text: group_requirement.share
            for group in self.pool.groups
            for group_requirement in requirements.group_requirements(group)
        }
        return np.array([known.get(text) or 1.0 for text in self.demands])

    @cached_property
    def met(self) -> np.ndarray:
        """The share of each design's cases that meet each demand, [design, demand]."""
        holds = self.pool.outcomes == 1 if self.pool.requirements else (self.pool.status == DONE)[:, None]
        counts = [np.bincount(self.of_case, weights=column, minlength=self.count) for column in holds.T]
        return np.stack(counts, axis=1) / self.cases[:, None]

    @cached_property
    def meets(self) -> np.ndarray:
        """[design, demand] whether it meets it."""
        return np.asarray(self.met >= self.shares * (1.0 - ROUNDING))

    @cached_property
    def failing(self) -> np.ndarray:
        """[design] the number of its cases that did not reach their end."""
        return np.bincount(self.of_case, weights=self.pool.status != DONE, minlength=self.count).astype(np.int64)

    def missed(self, design: int) -> list[str]:
        """The demands that a design does not meet, without those missed only by failed cases."""
        ended = (self.of_case == design) & (self.pool.status == DONE)
        outcomes = self.pool.outcomes[ended] if self.pool.requirements else np.ones((int(ended.sum()), 1))
        short = ~self.meets[design] & (outcomes != 1).any(axis=0)
        return [text for text, falls_short in zip(self.demands, short, strict=True) if falls_short]

    @cached_property
    def good(self) -> np.ndarray:
        """[design] whether it meets all."""
        return np.asarray(self.meets.all(axis=1))

    @cached_property
    def room(self) -> np.ndarray:
        """The smallest distance of a design's cases from the limit of a demand on all cases, as a share of the limit,
        [design]; infinite where there is none."""
        far = np.full(self.pool.count, -np.inf)
        for group_number, group in enumerate(self.pool.groups):
            in_group = self.pool.group_of == group_number
            for group_requirement in requirements.group_requirements(group):
                if group_requirement.share is None:
                    values = group.values(group_requirement.metric)
                    beyond = requirements.beyond(values, group_requirement.comparison, group_requirement.limit)
                    far[in_group] = np.maximum(far[in_group], beyond[self.pool.position_of[in_group]])
        return -self.worst(far, largest=True)

    def worst(self, values: np.ndarray, *, largest: bool) -> np.ndarray:
        """The largest, or smallest, value of each design's cases, [design]; not-a-number where a case has none."""
        out = np.full(self.count, -np.inf if largest else np.inf)
        with np.errstate(invalid="ignore"):
            (np.maximum if largest else np.minimum).at(out, self.of_case, values)
        return out

    def goal(self, text: str) -> Goal:
        """The goal of the text `METRIC`, `EXPRESSION` or `METRIC:largest`: by default the largest for a margin, and
        else the least. Raises Problem."""
        name, colon, way = text.rpartition(":")
        expressions, has_way = CaseExpressions(self.pool), bool(colon) and way.strip() in ("largest", "smallest")
        if not has_way:
            name = text
        largest = way.strip() == "largest" if has_way else expressions.is_margin(name)
        values, dimension = expressions.values(name)
        return Goal(name.strip(), largest, values, dimension)

    # The border

    @cached_property
    def steps(self) -> np.ndarray | None:
        """The number of grid steps from each design to the border, in any direction, [design]: 0 where it is not good.
        None where the designs do not form a grid."""
        from scipy.ndimage import distance_transform_cdt

        grid = self._grid
        if grid is None:
            return None
        good = grid >= 0
        good[good] = self.good[grid[good]]
        steps = np.zeros(self.count, np.int64)
        kinds = [number for number, axis in enumerate(self.axes) if not axis.ordered]
        shape = [len(self.axes[number].values) for number in kinds]
        for kind in np.ndindex(*shape):
            cell: list[int | slice] = [slice(None)] * len(self.axes)
            for number, level in zip(kinds, kind, strict=True):
                cell[number] = level
            part = grid[tuple(cell)]
            if part.ndim == 0:  # choices alone: none is next to another
                if part >= 0:
                    steps[int(part)] = int(good[tuple(cell)])
                continue
            near = distance_transform_cdt(np.pad(good[tuple(cell)], 1), metric="chessboard")
            inner = near[(slice(1, -1),) * part.ndim]
            steps[part[part >= 0]] = inner[part >= 0]
        return steps

    @cached_property
    def _grid(self) -> np.ndarray | None:
        """The design in each cell of the grid of all axes' levels, -1 where there is none; None where they do not form
        a grid."""
        sizes = [len(axis.values) for axis in self.axes]
        cells = int(np.prod([float(size) for size in sizes]))
        if any(np.isnan(column.values[self.first]).any() for axis in self.axes for column in axis.columns):
            return None  # a sum of sweeps, which choose other parameters
        if cells > MOST_CELLS or self.count <= FULL * cells:
            return None
        out = np.full(sizes, -1)
        out[tuple(axis.level for axis in self.axes)] = np.arange(self.count)
        return out

    def stretch(self, design: int, axis: int) -> Stretch | None:
        """The range of a good design along an axis; None where that has no order, or the designs do not form a grid."""
        if self._grid is None or not self.axes[axis].ordered:
            return None
        line_index: list[int | slice] = [int(axis.level[design]) for axis in self.axes]
        own = int(self.axes[axis].level[design])
        line_index[axis] = slice(None)
        line = self._grid[tuple(line_index)]
        ends = []
        for step in (-1, 1):
            level = own
            while 0 <= level + step < len(line) and line[level + step] >= 0 and self.good[line[level + step]]:
                level += step
            beyond = level + step
            why = ENDS if not 0 <= beyond < len(line) else UNKNOWN if line[beyond] < 0 else self._why(line[beyond])
            ends.append((level, why))
        (first, below), (last, above) = ends
        return Stretch(first, last, below, above)

    def _why(self, design: int) -> str:
        """The demands that a design does not meet, in words."""
        missed = [text for text, met in zip(self.demands, self.meets[design], strict=True) if not met]
        if missed == [FAILS]:
            return FAILS
        return f"`{missed[0]}`" + (f" and {len(missed) - 1} more" if len(missed) > 1 else "")

    # The ranking

    def order(self, goals: Sequence[Goal] = ()) -> np.ndarray:
        """The good designs, the best first: by the goals in the worst of their cases, one after the other; then, or
        without goals, by the steps to the border, by the share of cases that meet each demand, and by the distance to
        the nearest limit."""
        good = np.flatnonzero(self.good)
        keys = [self._wanted(goal)[good] for goal in goals]
        if self.steps is not None:
            keys.append(-self.steps[good].astype(float))
        keys += [-self.met.min(axis=1)[good], -self.room[good]]
        return good[np.lexsort(keys[::-1])]

    def _wanted(self, goal: Goal) -> np.ndarray:
        """A goal in the worst of each design's cases, as a number to minimise, [design]; designs without one come
        last."""
        worst_values = self.worst(-goal.values if goal.largest else goal.values, largest=True)
        return np.where(np.isnan(worst_values), np.inf, worst_values)

    def front(self, goals: Sequence[Goal]) -> np.ndarray:
        """The Pareto front: good designs that no other dominates in all goals, by the first goal."""
        good = np.flatnonzero(self.good)
        numbers = np.stack([self._wanted(goal)[good] for goal in goals], axis=1)
        order = np.lexsort(numbers.T[::-1])
        front: list[int] = []
        for i in order.tolist():
            if (numbers[i] < np.inf).all() and not any((numbers[j] <= numbers[i]).all() for j in front):
                front.append(i)
        return good[front]


def varied_columns(pool: Pool) -> list[CaseColumn]:
    """The choices and parameters in which cases differ."""
    columns = [column for column in pool.columns if column.role in ("choice", "parameter")]
    return [column for column in columns if len(distinct(column.values[np.isfinite(column.values)])) > 1]


def _check_chosen(drawn: Sequence[str], choose: Sequence[str]) -> None:
    """Raise Problem E394 where a chosen parameter is drawn: each of its values comes with other values of its own."""
    chosen = [path for path in drawn if path in choose]
    others = [path for path in drawn if path not in choose]
    if chosen and others:
        message = f"`{chosen[0]}` is drawn, and each of its values comes with one of `{others[0]}`"
        helps = [f"choose both: `--choose {others[0]}`", f"or `vary {chosen[0]} = [...];` beside the sample"]
        raise Problem(error("E394", message, help=helps))


def check_varied(pool: Pool, paths: Sequence[str]) -> None:
    """Raises Problem E394 for a path that varies in no case."""
    known = [column.label for column in varied_columns(pool)]
    for path in paths:
        if path not in known:
            fixed = [column.label for column in pool.columns if column.role in ("choice", "parameter")]
            message = f"no varied parameter `{path}` in `{pool.name}`"
            if path in fixed:
                message = f"`{path}` is the same in all cases of `{pool.name}`"
            helps = [*did_you_mean(path, known), f"varied: {', '.join(known) or 'nothing'}"]
            raise Problem(error("E394", message, help=helps))
