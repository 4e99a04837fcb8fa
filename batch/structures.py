"""A sweep of several structures in one table: what each is, how its cases went, its metrics side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from batch.archive.read import ArchiveFile, Group
from batch.signals import deck_unit, number_text


def structures(archive: ArchiveFile) -> Iterator[list[str]]:
    """The table of each sweep that has several structures, under its name and how all of its cases went."""
    for sweep in dict.fromkeys(group.sweep for group in archive.groups if group.sweep):
        groups = [group for group in archive.groups if group.sweep == sweep]
        if len(groups) > 1:
            yield [*_all_of(sweep, groups), *_table(groups)]


def _all_of(sweep: str, groups: Sequence[Group]) -> list[str]:
    """How the sweep went as a whole: how many cases reached their end, and met each requirement."""
    cases = sum(group.count for group in groups)
    done = sum(int((group.values("status") == 0).sum()) for group in groups)
    out = [f"{sweep}: {done:,} of {cases:,} cases reached their end, of {len(groups)} structures"]
    yields: dict[str, list[int]] = {}
    for group in groups:
        for text, met in _met(group).items():
            of = yields.setdefault(text, [0, 0])
            of[0], of[1] = of[0] + met, of[1] + group.count
    wide = max(map(len, yields), default=0)
    for text, (met, of_all) in yields.items():
        out.append(f"  require {text:<{wide}}  met by {met:,} of {of_all:,} ({100 * met / of_all:.3g} %)")
    return out


def _table(groups: Sequence[Group]) -> list[str]:
    """A row a structure: its name, cases, how many meet all, and the median of each metric, in the deck's unit."""
    from ic.printing.columns import columns

    metrics = list(dict.fromkeys(variable.name for group in groups for variable in group.role("metric")))
    judged = any(_met(group) for group in groups)
    units = {v.name: deck_unit(v)[1] for group in reversed(groups) for v in group.role("metric")}
    head = ["", "cases", *(["meet all"] if judged else []), *metrics]
    rows = [head]
    if metrics:
        rows.append(["median of the cases:", "", *([""] if judged else []), *(units[name] for name in metrics)])
    for group in groups:
        met = group.values("met") if "met" in group.variables else np.ones((group.count, 0), np.int8)
        whole = [str(int((met == 1).all(axis=1).sum()))] if judged else []
        known = {variable.name: variable for variable in group.role("metric")}
        scales = {variable.name: deck_unit(variable)[0] for variable in known.values()}
        cells = [_median(group, name, scales[name]) if name in known else "" for name in metrics]
        rows.append([group.name, str(group.count), *whole, *cells])
    return ["", *columns(rows, right=range(1, len(head)))]


def _median(group: Group, name: str, scale: float) -> str:
    """The middle of a metric's values, of which infinite ones count; `-` where none is a number."""
    values = np.sort(group.values(name))
    values = values[~np.isnan(values)] / scale
    if not len(values):
        return "-"
    half = len(values) // 2
    return number_text(float(values[half] if len(values) % 2 else 0.5 * (values[half - 1] + values[half])))


def _met(group: Group) -> dict[str, int]:
    """How many cases of a group meet each requirement."""
    if "met" not in group.variables:
        return {}
    met = group.values("met")
    return {str(text): int((met[:, n] == 1).sum()) for n, text in enumerate(group.values("requirement"))}
