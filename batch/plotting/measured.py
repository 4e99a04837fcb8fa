"""A metric of the cases of a run or sweep, in the deck's unit: its values, missed requirements, and description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from batch.plotting.against import OtherGroup, not_in_other, other_unit
from batch.plotting.layout import drawable, with_unit
from batch.queries import requirements
from batch.queries.pool import CaseColumn, Pool
from batch.queries.signals import deck_unit
from met.frozen import frozen
from met.run import DONE


@frozen
class MapMetric:
    """values, theirs: of each case, theirs of the same case in another archive, none where there is no other; missed,
    theirs_missed: whether a requirement of the metric is, of each archive its own; both: whether a case is in both,
    True where there is no other."""

    column: CaseColumn
    values: np.ndarray
    missed: np.ndarray
    failed: np.ndarray
    theirs: np.ndarray | None = None
    theirs_missed: np.ndarray | None = None
    both: np.ndarray | bool = True

    @property
    def label(self) -> str:
        """The label of the axis, with its unit."""
        return with_unit(self.column.label, self.column.unit)

    @property
    def worse(self) -> str:
        """The direction of its first limit, as `grids.cell_cases` takes it."""
        return self.column.limits[0].sense if self.column.limits else ""

    @property
    def about(self) -> str:
        """The metric's description, with the number of cases that miss its requirements."""
        parts = [self.column.about] if self.column.about else []
        count = len(self.values)
        if self.column.limits:
            texts = " and ".join(limit.text for limit in self.column.limits)
            missed = int(self.missed.sum())
            parts.append(f"{texts}: missed by {missed:,} of {count:,}" if missed else f"{texts}: missed by none")
        return " · ".join(parts)

    @property
    def difference(self) -> np.ndarray:
        """Own value less the other's; 0 where both are infinite with the same sign."""
        assert self.theirs is not None
        same = self.values == self.theirs
        with np.errstate(invalid="ignore"):
            return np.where(same, 0.0, self.values - self.theirs)


def map_metrics(pool: Pool, names: Sequence[str], others: Mapping[int, OtherGroup]) -> list[MapMetric]:
    """The metrics of these names, all for none. others: by number of a group that of another archive. Raises Problem
    E393 for a metric that it has in another unit, or which is named and not there."""
    failed, both = pool.status != DONE, _both(pool, others)
    columns = {column.key.partition(":")[2]: column for column in pool.metrics()}
    out = []
    for name in names or columns:
        column = columns[name]
        theirs = _theirs(pool, name, others, bool(names))
        out.append(MapMetric(column, drawable(column.values), pool.missed(column), failed, *theirs, both))
    return out


def _both(pool: Pool, others: Mapping[int, OtherGroup]) -> np.ndarray | bool:
    """True of each case that the other archive has too, [case]."""
    if not others:
        return True
    out = np.zeros(pool.count, bool)
    for number, other in others.items():
        in_group = pool.group_of == number
        out[in_group] = other.places[pool.position_of[in_group]] >= 0
    return out


def _theirs(
    pool: Pool, name: str, others: Mapping[int, OtherGroup], named: bool
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """The metric of each case in the other archive, in the own unit, and True where it misses its requirement there."""
    if not others:
        return None, None
    out, missed, any_group = np.full(pool.count, np.nan), np.zeros(pool.count, bool), False
    for number, other in others.items():
        variable = other.group.variables.get(name)
        mine = pool.groups[number].variables.get(name)
        if mine is None:
            continue
        if variable is None or variable.role != "metric":
            if named:
                raise not_in_other(name, other, [metric.name for metric in other.group.role("metric")])
            continue
        if variable.unit != mine.unit:
            raise other_unit(name, mine.unit, variable.unit, other)
        any_group = True
        places_here = np.flatnonzero(pool.group_of == number)
        places = other.places[pool.position_of[places_here]]
        places_here, places = places_here[places >= 0], places[places >= 0]
        out[places_here] = drawable(other.group.values(name)[places] / deck_unit(mine)[0])
        columns = [asked.place for asked in requirements.group_requirements(other.group) if asked.metric == name]
        missed[places_here] = (requirements.outcomes(other.group)[places][:, columns] == 0).any(axis=1)
    return (out, missed) if any_group else (None, None)
