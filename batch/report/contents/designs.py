"""The design to use, as in `met best`: the first answer of a report on a sweep with choices."""

from __future__ import annotations

import numpy as np

from batch.archive.read import ArchiveFile
from batch.campaigns.judging import judged_best
from batch.queries.best import DesignAxis, Designs
from batch.queries.best_answer import BestAnswer, context
from batch.queries.pool import CaseColumn, Pool
from batch.queries.signals import number_text
from batch.report.contents.parts import DesignAnswer, DesignMap, TextTable
from batch.report.contents.searches import search_answer
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
    return DesignMap(_name(x), _name(y), _unit(x), _unit(y), _texts(x), _texts(y), cells, best_cell)


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _first(axis: DesignAxis) -> CaseColumn:
    return axis.columns[0]


def _name(axis: DesignAxis) -> str:
    return " with ".join(column.label for column in axis.columns)


def _unit(axis: DesignAxis) -> str:
    return _first(axis).unit


def _texts(axis: DesignAxis) -> tuple[str, ...]:
    return tuple(number_text(float(value)) for value in axis.values)
