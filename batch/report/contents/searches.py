"""The answer of a search with its progress: the first answer of a report on a search."""

from __future__ import annotations

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries.search_answers import SearchAnswer
from batch.queries.search_result import search_result
from batch.queries.signals import deck_unit
from batch.queries.stability_words import unwrapped
from batch.report.contents.parts import DesignAnswer, TextTable

MOST_LOOKS, MOST_ROWS = 200, 24
"""Largest number of generations after which a report examines the best, spread over all; and of rows for those that
changed it."""


def search_answer(archive: ArchiveFile, group: ArchiveGroup) -> DesignAnswer | None:
    """The answer of a search with the best after each of some generations; None for other runs."""
    answer, result = SearchAnswer.of(group), search_result(archive, group)
    if answer is None or result is None:
        return None
    search = answer.search
    purpose, command = result.commands[-1]
    tunes = search.kind == "tune"
    heads = ("generation", "cases", search.metric, "", *([f"tried with, of {max(1, len(search.plants))}"] * tunes))
    rows: list[tuple[str, ...]] = []
    looks = answer.progress(MOST_LOOKS)
    for number, cases, best in looks:
        how = "a case fails" if best.failed else f"misses {', '.join(best.missed)}" if best.missed else "meets all"
        row = (str(number), f"{cases:,}", answer.value(best), how, *([str(best.tried)] * tunes))
        if not rows or rows[-1][2:] != row[2:]:
            rows.append(row)
    row_numbers = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_ROWS)).astype(int))
    scale, _ = deck_unit(next(metric for metric in group.role("metric") if metric.path == search.metric))
    headline, *why = unwrapped(answer.lines())
    return DesignAnswer(
        headline=headline[:1].upper() + headline[1:],
        why="\n".join(why),
        table=TextTable(heads, ("",) * len(heads), tuple(rows[n] for n in row_numbers), frozenset({0, 1, 2, 4})),
        stretches=None,
        purpose=purpose,
        command=command,
        notes=(),
        map=None,
        title="Progress over generations",
        about=f"The {'best' if tunes else 'worst'} so far, where it changed"
        + (": in the worst of the cases that it was tried with." if tunes else "."),
        heading="Which design to use" if tunes else "The worst case found",
        link="Which design" if tunes else "The worst case",
        chooses=tunes,
        case=answer.position,
        progress=tuple((cases, best.value / scale, best.tried) for _, cases, best in looks),
    )
