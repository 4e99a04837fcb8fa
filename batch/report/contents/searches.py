"""The answer of a search, and how it came: the first answer of a report on one."""

from __future__ import annotations

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries.search_answers import SearchAnswer
from batch.report.contents.parts import DesignAnswer, TextTable
from batch.terminal.search import search_result

MOST_GENERATIONS = 24
"""Generations that a report shows, spread over all."""


def search_answer(archive: ArchiveFile, group: ArchiveGroup) -> DesignAnswer | None:
    """The answer of a search with the best after each of some generations; None of what is none."""
    answer, result = SearchAnswer.of(group), search_result(archive, group)
    if answer is None or result is None:
        return None
    search = answer.search
    said, command = result.commands[-1]
    tunes = search.kind == "tune"
    heads = ("generation", "cases", search.metric, "", *([f"tried with, of {max(1, len(search.plants))}"] * tunes))
    rows = []
    for number, cases, best in answer.progress(MOST_GENERATIONS):
        how = "a case fails" if best.failed else f"misses {', '.join(best.missed)}" if best.missed else "meets all"
        rows.append((str(number), f"{cases:,}", answer.value(best), how, *([str(best.tried)] * tunes)))
    headline, *why = (line.strip() for line in answer.lines())
    return DesignAnswer(
        headline=headline[:1].upper() + headline[1:],
        why="; ".join(why),
        table=TextTable(heads, ("",) * len(heads), tuple(rows), frozenset({0, 1, 2, 4})),
        stretches=None,
        said=said,
        command=command,
        notes=(),
        map=None,
        title="Progress over generations",
        about="The best by then, in the worst of the cases that it was tried with." if tunes else "The worst by then.",
    )
