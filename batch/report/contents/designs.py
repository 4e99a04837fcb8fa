"""The design to use, as in `met best`, or the answer of a search with its progress: the first answer of a report."""

from __future__ import annotations

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.campaigns.judging import judged_best
from batch.queries.best import DesignAxis, Designs
from batch.queries.best_answer import BestAnswer
from batch.queries.given import context
from batch.queries.pool import Pool
from batch.queries.search_answers import SearchAnswer, search_result
from batch.queries.signals import deck_unit, number_text
from batch.queries.stability_words import unwrapped
from batch.report.contents.parts import DesignAnswer, DesignMap, TextTable
from met.diagnostic import Problem
from met.plan.searches import LEAST_MARGIN

MOST_CELLS = 10_000
"""Largest number of cells of a map: more would be smaller than a dot."""


def design_answer(archive: ArchiveFile, pool: Pool) -> DesignAnswer | None:
    """The answer for a sweep, or for a search; None where nothing is chosen in it, or there are no requirements."""
    if (searched := search_answer(archive, pool.groups[0])) is not None:
        return searched
    if pool.count < 2 or not pool.requirements:
        return None
    try:
        designs = Designs(pool)
    except Problem:  # there are no choices
        return None
    judged = judged_best(archive, designs, designs.order(), LEAST_MARGIN)
    answer = BestAnswer(designs, (), (), **context(archive, pool), judged=judged, least_margin=LEAST_MARGIN)
    if answer.best is None:
        table = _table(answer.cells(answer.nearest()), answer.right)
        return DesignAnswer(
            _sentence(answer.headline), "Those that come nearest are below.", table, None, "", "", (), None
        )
    sentence, command = answer.confirmation()
    stretches = tuple(map(tuple, answer.stretches()))
    heads = ("how far each may go", "by itself", "what ends it")
    return DesignAnswer(
        headline=_sentence(answer.headline),
        why=_sentence(answer.why),
        table=_table(answer.cells(answer.rows()), answer.right),
        stretches=TextTable(heads, ("",) * 3, stretches) if stretches else None,
        purpose=_sentence(sentence),
        command=command,
        notes=tuple(f"{_sentence(note)}." for note in (*answer.stability(), *answer.notes())),
        map=design_map(designs, answer.best),
        case=next(int(pool.cases[place]) for place in pool.worst_first if designs.of_case[place] == answer.best),
    )


def _table(cells: list[list[str]], right: list[int]) -> TextTable:
    """A table of cells whose first row has the heads and second the units. right: columns that are flush right"""
    heads, units, *rows = cells
    return TextTable(tuple(heads), tuple(units), tuple(map(tuple, rows)), frozenset(right))


def design_map(designs: Designs, best: int) -> DesignMap | None:
    """The map over the two ordered axes that have most values; the others have the best design's values."""
    sides = sorted((axis for axis in designs.axes if axis.ordered), key=lambda axis: -len(axis.values))[:2]
    steps = designs.steps
    if len(sides) < 2 or steps is None or len(sides[0].values) * len(sides[1].values) > MOST_CELLS:
        return None
    x, y = sorted(sides, key=designs.axes.index)
    in_plane = np.ones(designs.count, bool)
    for axis in designs.axes:
        if axis is not x and axis is not y:
            in_plane &= axis.level == axis.level[best]
    cells = np.full((len(y.values), len(x.values)), -1)
    cells[y.level[in_plane], x.level[in_plane]] = steps[in_plane]
    best_cell = int(y.level[best]), int(x.level[best])
    return DesignMap(_name(x), _name(y), x.columns[0].unit, y.columns[0].unit, _texts(x), _texts(y), cells, best_cell)


def _sentence(text: str) -> str:
    """A text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def _name(axis: DesignAxis) -> str:
    return " with ".join(column.label for column in axis.columns)


def _texts(axis: DesignAxis) -> tuple[str, ...]:
    return tuple(number_text(float(value)) for value in axis.values)


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
        row = (str(number), f"{cases:,}", answer.goal(best.value), how, *([str(best.tried)] * tunes))
        if not rows or rows[-1][2:] != row[2:]:
            rows.append(row)
    row_numbers = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_ROWS)).astype(int))
    scale, _ = deck_unit(next(metric for metric in group.role("metric") if metric.path == search.metric))
    headline, *why = unwrapped(answer.lines())
    return DesignAnswer(
        headline=_sentence(headline),
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
