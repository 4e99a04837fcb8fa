"""The order in which cases are listed: worst first, or by metrics and varied parameters, one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.queries.pool import Pool, pools
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen

REPEAT = "repeat"

WAYS = {"smallest": False, "largest": True}
"""Words after a name, `settle:largest`; True where the largest comes first."""


@frozen
class CaseOrder:
    """An order by a metric's name, a varied parameter's path, or `repeat`; smallest first, unless `largest`. then: the
    order among equal cases"""

    name: str
    largest: bool = False
    then: tuple[CaseOrder, ...] = ()

    @property
    def keys(self) -> tuple[CaseOrder, ...]:
        return (self, *self.then)

    @property
    def title(self) -> str:
        words = [f"{key.name}, {'largest' if key.largest else 'smallest'} first" for key in self.keys]
        return f"cases by {'; then by '.join(words)}:"


def by_names(names: Sequence[str], *, reverse: bool = False) -> CaseOrder | None:
    """In the order of these names, each `NAME`, `NAME:largest` or `NAME:smallest`; None where there are none. reverse:
    largest first of all that do not say it themselves. Raises Problem E329."""
    keys: list[CaseOrder] = []
    for name_text in names:
        name, colon, way = (
            (name_text, "", "") if "," in name_text else name_text.partition(":")
        )  # `check` reports several in one
        if colon and way not in WAYS:
            helps = f"`--sort {name}:largest`, or `--sort {name}:smallest`"
            raise Problem(
                error(
                    "E329", f"`{name_text}` is no order of cases: `{way}` is neither largest nor smallest", help=helps
                )
            )
        if name in [key.name for key in keys]:
            raise Problem(error("E329", f"cases are to be listed by `{name}` twice", help="leave one out"))
        keys.append(CaseOrder(name, WAYS[way] if colon else reverse))
    return _joined(keys)


def _joined(keys: Sequence[CaseOrder]) -> CaseOrder | None:
    return CaseOrder(keys[0].name, keys[0].largest, tuple(keys[1:])) if keys else None


def check(groups: Sequence[ArchiveGroup], by: CaseOrder | None) -> None:
    """Raise Problem E329 where no group has the quantity of the order, or each has only one case."""
    if by is None:
        return
    known = list(_names(groups))
    for key in by.keys:
        if key.name not in known:
            parts = [part.strip() for part in key.name.split(",")]
            if len(parts) > 1 and all(part.partition(":")[0] in known for part in parts):
                helps = [f"one name each: `{' '.join(f'--sort {part}' for part in parts)}`"]
            else:
                helps = [*did_you_mean(key.name, known), *([f"here: {', '.join(known)}"] if known else [])]
            raise Problem(error("E329", f"no metric or varied parameter `{key.name}`", help=helps))
    if all(len(pool.cases) == 1 for pool in pools(groups)):
        names = " and ".join(f"`{group.name}`" for group in groups)
        verb = "is" if len(groups) == 1 else "are each"
        raise Problem(
            error(
                "E329", f"{names} {verb} one case: there is nothing to list by `{by.name}`", help="a sweep has several"
            )
        )


def places(pool: Pool, by: CaseOrder | None = None) -> np.ndarray:
    """Places of the cases in this order, equal ones in the order of the case table and cases without a value last;
    worst first where there is no order, or no case has the quantity."""
    by = order_of(pool.groups, by)
    if by is None:
        return pool.worst_first
    names = _names(pool.groups)
    keys = [-values if key.largest else values for key in by.keys for values in [pool.gathered(names[key.name])]]
    return np.lexsort(keys[::-1])


def order_of(groups: Sequence[ArchiveGroup], by: CaseOrder | None) -> CaseOrder | None:
    """The part of an order whose names these groups have; None where they have none of them."""
    names = _names(groups) if by is not None else {}
    return _joined([key for key in by.keys if key.name in names]) if by is not None else None


def _names(groups: Sequence[ArchiveGroup]) -> dict[str, str]:
    """Names by which cases may be listed, in users' notation, with the variable of each."""
    variables = [variable for group in groups for variable in (*group.role("metric"), *group.role("coordinate"))]
    by_path = {variable.path: variable.name for variable in variables}
    if any(REPEAT in group.variables and group.values(REPEAT).any() for group in groups):
        by_path.setdefault(REPEAT, REPEAT)
    return by_path
