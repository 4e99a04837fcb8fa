"""Which cases are listed: those in which a condition holds, the worst over varied parameters, those that meet all
requirements; and in which order: worst first, or by metrics and varied parameters, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries.best import check_varied, varied_columns
from batch.queries.expressions import CaseExpressions
from batch.queries.pool import ENDED, Pool, pools
from batch.queries.signals import deck_unit
from batch.queries.summary import Summary, median_text, summary_of
from batch.queries.tallies import summed_up
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen
from met.statistics.design_points import design_points

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


def structures(archive: ArchiveFile) -> Iterator[list[str]]:
    """The table of each sweep with several structures, under its name and the outcomes of all its cases."""
    for sweep in dict.fromkeys(group.sweep for group in archive.groups if group.sweep):
        groups = [group for group in archive.groups if group.sweep == sweep]
        if len(groups) > 1:
            yield [*_all_of(sweep, [summary_of(group) for group in groups]), *_table(groups)]


def _all_of(sweep: str, summaries: Sequence[Summary]) -> Iterator[str]:
    """Lines about the sweep as a whole: the number of cases that reached their end, and that met each requirement."""
    cases, failed = (sum(getattr(summary, name) for summary in summaries) for name in ("cases", "failed"))
    yield f"{sweep}: {cases - failed:,} of {cases:,} cases reached their end, of {len(summaries)} structures"
    texts = list(dict.fromkeys(r.text for summary in summaries for r in summary.requirements))
    wide = max(map(len, texts), default=0)
    for text in texts:
        met_counts = [(summary.cases, r.met) for summary in summaries for r in summary.requirements if r.text == text]
        all_cases, met = map(sum, zip(*met_counts, strict=True))
        yield f"  require {text:<{wide}}  met by {met:,} of {all_cases:,} ({100 * met / all_cases:.3g} %)"


def _table(groups: Sequence[ArchiveGroup]) -> list[str]:
    """A row for each structure: its name, its cases, the number that meet all requirements, and the median of each
    metric, in the deck's unit."""
    from ic.printing.columns import columns

    metrics = list(dict.fromkeys(variable.name for group in groups for variable in group.role("metric")))
    judged = any("met" in group.variables for group in groups)
    units = {v.name: deck_unit(v)[1] for group in reversed(groups) for v in group.role("metric")}
    head = ["", "cases", *(["meet all"] if judged else []), *metrics]
    rows = [head]
    if metrics:
        rows.append(["median of the cases:", "", *([""] if judged else []), *(units[name] for name in metrics)])
    for group in groups:
        if summed_up(group) is not None:
            rows.append([group.name, str(group.run), *(["-"] * judged), *("-" for _ in metrics)])
            continue
        met = group.values("met") if "met" in group.variables else np.ones((group.count, 0), np.int8)
        whole = [str(int((met == 1).all(axis=1).sum()))] if judged else []
        scales = {variable.name: deck_unit(variable)[0] for variable in group.role("metric")}
        cells = [median_text(group.values(name) / scales[name]) if name in scales else "" for name in metrics]
        rows.append([group.name, str(group.count), *whole, *cells])
    return ["", *columns(rows, right=range(1, len(head)))]
