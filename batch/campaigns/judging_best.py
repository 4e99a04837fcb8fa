"""The stability of the designs of a sweep, judged when it is asked which is best."""

from __future__ import annotations

from functools import cache

import numpy as np

from batch.archive.read import ArchiveFile
from batch.campaigns.judging import judged_design, judged_until_kept
from batch.queries.best import Designs
from met import run as engine
from met.diagnostic import Problem
from met.plan.searches import JudgedDesign


def judged_best(file: ArchiveFile, designs: Designs, order: np.ndarray, least_margin: float) -> dict[int, JudgedDesign]:
    """The stability of designs, by their numbers, in this order, until one keeps the least margin. A design whose cases
    are of several structures is judged by the least margin of them."""
    if not least_margin or not len(order):
        return {}
    try:
        experiments = {experiment.name: experiment for experiment in file.plan().experiments}
    except Problem as problem:  # for instance, a model of the plan is not installed here
        first = int(order[0])
        case = int(designs.pool.cases[designs.first[first]])
        return {first: JudgedDesign(case, None, problem.diagnostics[0].message)}

    @cache
    def prepared(name: str) -> engine.Prepared:
        return engine.prepare(experiments[name])

    def judge(place: int) -> JudgedDesign:
        pool, judgements = designs.pool, list[JudgedDesign]()
        cases = np.flatnonzero(designs.of_case == order[place])
        for number in np.unique(pool.group_of[cases]).tolist():
            group = pool.groups[number]
            own = pool.position_of[cases[pool.group_of[cases] == number]]
            rows = np.searchsorted(experiments[group.name].cases.table, group.values("case")[own])
            judgements.append(judged_design(prepared(group.name), rows))
        known = [judgement for judgement in judgements if judgement.margins is not None]
        return min(known, key=lambda judgement: judgement.margins.disk) if known else judgements[0]  # type: ignore[union-attr]

    judged = judged_until_kept(len(order), judge, least_margin)
    return {int(order[place]): design for place, design in judged.items()}
