"""Some of the cases of a run or sweep: those in which a condition holds, the worst over varied parameters, those that
meet all requirements."""

from __future__ import annotations

import numpy as np

from batch.queries.best import check_varied, varied_columns
from batch.queries.expressions import CaseExpressions
from batch.queries.pool import ENDED, Pool
from met.frozen import frozen
from met.statistics.design_points import design_points


@frozen
class CaseSelection:
    """The cases that are asked for.

    where  a condition on metrics and what varies, "" for none
    over   paths of what varies: of these cases that differ in the paths alone the worst
    met    only those, of these, that meet all requirements
    """

    where: str = ""
    over: tuple[str, ...] = ()
    met: bool = False

    @property
    def everything(self) -> bool:
        """True if no case is left out."""
        return not (self.where or self.met or self.over)

    def places(self, pool: Pool) -> np.ndarray:
        """Places of the selected cases in a pool (the cases of a run or sweep over all its structures), in its order.
        Raises Problem for an invalid condition, or an unknown path."""
        keep = np.ones(pool.count, bool)
        if self.where:
            keep &= CaseExpressions(pool).holds(self.where)
        if self.over:
            check_varied(pool, self.over)
            others = [column.values for column in varied_columns(pool) if column.label not in self.over]
            worst = pool.worst_first[keep[pool.worst_first]]
            keep = np.zeros(pool.count, bool)
            keep[worst[np.unique(design_points(others, pool.count)[worst], return_index=True)[1]]] = True
        if self.met:
            keep &= np.isin(pool.ended, [ENDED.index("met"), ENDED.index("done")])
        return np.flatnonzero(keep)

    def words(self, chosen: int, count: int) -> str:
        """The number of these cases, and their choice, in words."""
        over = f"the worst over {', '.join(self.over)}" if self.over else ""
        parts = [f"where {self.where}" if self.where else "", over, "those that meet all" if self.met else ""]
        return f"{chosen:,} of {count:,} cases: {', '.join(part for part in parts if part)}"
