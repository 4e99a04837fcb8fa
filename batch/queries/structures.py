"""A sweep of several structures in one table: each structure, the outcomes of its cases, its metrics side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries.signals import deck_unit
from batch.queries.streamed import summed_up
from batch.queries.summary import Summary, median_text, summary_of


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
