"""The stability of designs: of those that a tuning has found, judged when it has run, and of a sweep's, when asked.

Cases of a design are run again, to know the poses that they pass. All that is computed depends on the tuning's cases
alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from batch.archive.read import ArchiveFile
from batch.queries.best import Designs
from met import run as engine
from met.analysis.passed import Passed
from met.analysis.stability import least_margins
from met.diagnostic import Problem
from met.passing import Memories
from met.plan import Coordinate
from met.plan.searches import JudgedDesign, Search

MOST_DESIGNS = 12
"""Largest number of designs that are judged."""

MOST_CASES, MOST_POSES, LEAST_POSES = 32, 48, 3
"""Largest number of a design's cases that are looked at; of poses of all of them; and the smallest of each: its start,
its middle and its end."""

MOST_STEPS = 50_000_000
"""Largest number of steps of joints that are run again for a design, some ten seconds."""


def judged_designs(
    prepared: engine.Prepared, search: Search, designs: Sequence[np.ndarray]
) -> tuple[JudgedDesign, ...]:
    """The stability of designs, in their order, until one keeps the least margin. designs: rows of the case table of
    each, the worst by the goal first"""

    def judge(number: int) -> JudgedDesign:
        return judged_design(prepared, designs[number])

    return tuple(judged_until_kept(len(designs), judge, search.least_margin).values())


def judged_until_kept(count: int, judge: Callable[[int], JudgedDesign], least_margin: float) -> dict[int, JudgedDesign]:
    """The designs that are judged among `count`, which are in order, the best first: until one keeps the least margin.

    Where many do not, the distance to the next that is judged doubles, since neighbours in the order are much alike;
    when one keeps it, those in between are judged by halving.
    """
    judged: dict[int, JudgedDesign] = {}

    def keeps(number: int) -> bool:
        if number not in judged:
            judged[number] = judge(number)
        return judged[number].keeps(least_margin)

    last, number, stride = -1, 0, 1
    while number < count and len(judged) < MOST_DESIGNS and not keeps(number):
        last, number, stride = number, min(number + stride, max(number + 1, count - 1)), 2 * stride
    while number in judged and judged[number].keeps(least_margin) and number - last > 1 and len(judged) < MOST_DESIGNS:
        middle = (last + number) // 2
        last, number = (last, middle) if keeps(middle) else (middle, number)
    return dict(sorted(judged.items()))


def judged_design(prepared: engine.Prepared, cases: np.ndarray) -> JudgedDesign:
    """The stability of a design with these cases, as rows of the experiment, the worst by the goal first."""
    experiment = prepared.experiment
    first, looked_at = int(experiment.cases.table[cases.min()]), telling_cases(cases, experiment.cases.coordinates)
    try:
        margins = least_margins(experiment, _passed(prepared, looked_at))
    except Problem as problem:
        return JudgedDesign(first, None, problem.diagnostics[0].message)
    return JudgedDesign(first, None, margins) if isinstance(margins, str) else JudgedDesign(first, margins)


def _passed(prepared: engine.Prepared, cases: np.ndarray) -> Passed:
    """Instants that cases pass, evenly from the start to the end; the start alone where running them again would take
    long."""
    schedule, joints = prepared.experiment.structure.schedule, len(prepared.experiment.structure.moving)
    steps = schedule.ticks // schedule.dynamics
    if steps * joints * len(cases) > MOST_STEPS:
        return Passed(cases, np.zeros(len(cases), np.int64), {})
    count = max(LEAST_POSES, MOST_POSES // len(cases))
    ticks = tuple(sorted({n * steps // (count - 1) * schedule.dynamics for n in range(count)}))
    memories = Memories(ticks, frozenset(cases.tolist()))
    engine.compute(prepared, cases, record=False, memories=memories)
    every = np.concatenate([memories.by_case[case] for case in cases.tolist()])
    cells = {name: every[:, slot] for slot, name in enumerate(prepared.recording.cells)}
    return Passed(np.repeat(cases, len(ticks)), np.tile(ticks, len(cases)), cells)


def telling_cases(cases: np.ndarray, coordinates: Sequence[Coordinate]) -> np.ndarray:
    """The cases of a design to look at, in order: all of a few; of many the first that is given, which is the worst by
    the goal, those in which something that varies is smallest or largest, and others evenly."""
    ordered = np.sort(cases)
    if len(cases) <= MOST_CASES:
        return ordered
    wanted = [int(cases[0])]
    for coordinate in coordinates:
        values = np.asarray(coordinate.values)[ordered]
        wanted += [int(ordered[values.argmin()]), int(ordered[values.argmax()])]
    wanted += ordered[np.linspace(0, len(ordered) - 1, MOST_CASES).astype(int)].tolist()
    return np.sort(np.array(list(dict.fromkeys(wanted))[:MOST_CASES]))


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
        """The stability of a design over all its cases, judged by the worst structure. place: in the order of the
        designs"""
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
