"""In which order cases are listed: worst first, or by a metric or what is varied."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batch import requirements
from batch.archive.read import Group
from batch.pool import Pool, Role, pools
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen

REPEAT = "repeat"
ROLES: tuple[Role, ...] = ("metric", "parameter", "repeat")
"""Of columns that cases may be listed by."""


@frozen
class By:
    """A metric's name, a varied parameter's path, or `repeat`; smallest first, unless `largest`."""

    name: str
    largest: bool = False

    @property
    def title(self) -> str:
        return f"cases by {self.name}, {'largest' if self.largest else 'smallest'} first:"


def check(groups: Sequence[Group], by: By | None) -> None:
    """Raises Problem E329 where none of the groups has what cases are to be listed by, or each is of one case."""
    if by is None:
        return
    known = list(dict.fromkeys(name for group in groups for name in _names(group)))
    if by.name not in known:
        helps = [*did_you_mean(by.name, known), *([f"here: {', '.join(known)}"] if known else [])]
        raise Problem(error("E329", f"no metric or varied parameter `{by.name}`", help=helps))
    if all(len(pool.cases) == 1 for pool in pools(groups)):
        names = " and ".join(f"`{group.name}`" for group in groups)
        verb = "is" if len(groups) == 1 else "are each"
        raise Problem(error("E329", f"{names} {verb} one case: there is nothing to list by `{by.name}`",
                            help="a sweep has several"))  # fmt: skip


def positions(group: Group, by: By | None = None) -> np.ndarray:
    """Positions of the cases, by what is asked for, equal ones and those that have no value, which are last, in the
    order of the case table; worst first where nothing is asked for, or the group does not have it."""
    if by is None or not has(group, by):
        return worst_first(group)
    values = np.asarray(group.values(_names(group)[by.name]), np.float64)
    return np.argsort(-values if by.largest else values, kind="stable")


def across(pool: Pool, by: By) -> np.ndarray:
    """The same of the cases of all structures of a sweep, one of which has it: those of others are last."""
    [column] = [column for column in pool.columns if column.label == by.name and column.role in ROLES]
    return np.argsort(-column.values if by.largest else column.values, kind="stable")


def has(group: Group, by: By) -> bool:
    return by.name in _names(group)


def worst_first(group: Group) -> np.ndarray:
    """Positions of the cases: failed ones, then those that miss most requirements, then by how far they miss.

    How far is relative to the limit (to the largest value where the limit is 0); a case that meets all requirements
    stands by how close it comes to one. Without requirements the order is the case table's.
    """
    return requirements.worst_first(group.values("status"), requirements.outcomes(group), _far(group))


def _far(group: Group) -> np.ndarray:
    """How far each case is beyond the limit that it misses most."""
    worst = np.full(group.count, -np.inf)
    for each in requirements.required(group):
        far = requirements.beyond(group.values(each.metric), each.comparison, each.limit)
        worst = np.maximum(worst, far)
    return worst


def _names(group: Group) -> dict[str, str]:
    """What cases may be listed by, as users name it: the variable of each."""
    found = {variable.path: variable.name for variable in (*group.role("metric"), *group.role("coordinate"))}
    if REPEAT in group.variables and group.values(REPEAT).any():
        found.setdefault(REPEAT, REPEAT)
    return found
