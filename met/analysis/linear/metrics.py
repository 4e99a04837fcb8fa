"""Metrics of linear answers: the loops and poles of each case, after it has run, at the instant that the run names.

A case's numbers follow from the case alone: it is run up to the instant by the same machine code, and linearised by
itself. A margin without a limit is infinite, and a gain limit that was not found is given as far as it was searched; an
unstable loop has no margin.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from met import run as engine
from met.analysis.linear.answers import MOST_TOGETHER, LiftedPeriod, LinearQuestion, OpenLoop, of_deck
from met.analysis.linear.flow import Flow
from met.analysis.linear.plant import plants
from met.analysis.linear.standing import settled
from met.diagnostic import Problem
from met.passing import Memories
from met.plan.judged import (
    ANSWERED,
    AT_LIMIT,
    EVENT,
    FIGURES,
    NO_EQUILIBRIUM,
    NO_REST,
    NOTHING_DECAYS,
    OPEN,
    SEVERAL_TICKS,
    WHY_ANSWER,
    LinearFigure,
    LinearUse,
    MetricUse,
)
from met.program.build import METRIC

QUESTION = "linear question: "
"""Prefix of a `LinearUse`'s name: its question, among the companions of a prepared experiment."""


def compute(
    prepared: engine.Prepared,
    rows: np.ndarray,
    *,
    threads: int | None = None,
    record: bool = True,
    progress: Callable[[int], None] | None = None,
    memories: Memories | None = None,
) -> tuple[np.ndarray | None, np.ndarray]:
    """The answer of `met.run.compute`, with the metrics of linear answers in it. Raises Problem where such a question
    is wrong for all cases (`check`).

    progress  where there are such metrics, the first half of the cases counts as done when all have run
    """
    uses = _linear_uses(prepared)
    report = progress if not uses or progress is None else partial(_half, progress)
    history, outputs = engine.compute(
        prepared, rows, threads=threads, record=record, progress=report, memories=memories
    )  # fmt: skip
    for number, use in enumerate(uses):
        share = None if progress is None else partial(_rest, progress, number, len(uses), len(rows))
        _answer(prepared, use, rows, outputs, threads, share)
    return history, outputs


def _half(progress: Callable[[int], None], done: int) -> None:
    progress(done // 2)


def _rest(progress: Callable[[int], None], number: int, uses: int, cases: int, done: int) -> None:
    progress(cases // 2 + (cases - cases // 2) * (number * cases + done) // (uses * cases))


def check(prepared: engine.Prepared) -> None:
    """Raise Problem where a question of an experiment's metrics is wrong for all its cases: D372 to D374."""
    for use in _linear_uses(prepared):
        question(prepared, use).program  # noqa: B018 - making it is what finds it


def _linear_uses(prepared: engine.Prepared) -> list[LinearUse]:
    """The linear answers of which an experiment has metrics; none where its cases are driven on motor beds."""
    named = {linear_metric.of for linear_metric in prepared.experiment.linear_metrics}
    return [use for use in prepared.experiment.linear if use.name in named and not prepared.wire]


def question(prepared: engine.Prepared, use: LinearUse) -> LinearQuestion:
    """The deck's question about an experiment, kept with its prepared program."""
    key = QUESTION + use.name
    if key not in prepared.companions:
        deck_question = of_deck(prepared.experiment, use.name)
        if use.pose is None:
            deck_question.program.prepared = prepared
        prepared.companions[key] = deck_question
    companion: LinearQuestion = prepared.companions[key]
    return companion


def _answer(
    prepared: engine.Prepared,
    use: LinearUse,
    rows: np.ndarray,
    outputs: np.ndarray,
    threads: int | None,
    progress: Callable[[int], None] | None,
) -> None:
    """Write the metrics of one question into the outputs of these cases."""
    linear_question, names = question(prepared, use), prepared.outputs
    wanted = [linear_metric for linear_metric in prepared.experiment.linear_metrics if linear_metric.of == use.name]
    columns, why = [names.index(METRIC + metric.name) for metric in wanted], names.index(WHY_ANSWER + use.name)
    done = np.flatnonzero(outputs[:, names.index("failure")] == 0.0)
    inputs = engine.inputs(prepared.experiment, rows[done])
    for first in range(0, len(done), MOST_TOGETHER):
        some = done[first : first + MOST_TOGETHER].tolist()
        begun = linear_question.flows(inputs[first : first + MOST_TOGETHER], threads)
        places = [place for place, flow in zip(some, begun, strict=True) if flow is not None]
        stood = _standing(linear_question, [flow for flow in begun if flow is not None])
        maps = iter(linear_question.lifted([flow for flow in stood if flow is not None]))
        for place, flow in zip(places, stood, strict=True):
            lifted = NO_EQUILIBRIUM if flow is None else next(maps)
            outputs[place, columns], outputs[place, why] = _figures(linear_question, wanted, lifted, flow)
            if progress is not None:
                progress(place + 1)


def _standing(linear_question: LinearQuestion, flows: Sequence[Flow]) -> Sequence[Flow | None]:
    """The flows for the question: None for an arm that is to stand still and does not."""
    return settled(linear_question.program, flows) if linear_question.stands else flows


def _figures(
    linear_question: LinearQuestion,
    wanted: Sequence[MetricUse],
    lifted: LiftedPeriod | Problem | int,
    flow: Flow | None,
) -> tuple[list[float], float]:
    """The linear metrics of one case, and the reason why one or all are missing: `ANSWERED` where none is. lifted: the
    case's linearised period, or the reason why it has none; flow: its memory at the period's begin"""
    if not isinstance(lifted, LiftedPeriod) or flow is None:
        return [math.nan] * len(wanted), float(lifted if isinstance(lifted, int) else EVENT)
    loops = (
        [lifted.opened(loop) for loop in linear_question.loops]
        if any(FIGURES[e.model].of_loops for e in wanted)
        else []
    )
    figures = [FIGURES[metric.model] for metric in wanted]
    answers = [
        _of_way(figure, linear_question, lifted, flow) if figure.of_way else _figure(figure, lifted, loops)
        for figure in figures
    ]
    return [value for value, _ in answers], float(max(why for _, why in answers))


def _of_way(
    figure: LinearFigure, linear_question: LinearQuestion, lifted: LiftedPeriod, flow: Flow
) -> tuple[float, int]:
    """A figure of the way from one input to one output."""
    if lifted.map.at_limit:
        return math.nan, AT_LIMIT
    bandwidth = lifted.bandwidth(linear_question.inputs)
    if math.isnan(bandwidth):
        return math.nan, NO_REST
    if figure.name == "bandwidth" or bandwidth == 0.0:
        return bandwidth or figure.unstable, ANSWERED
    [plant] = plants(linear_question.program, [flow], [lifted.states])
    bending = plant.first_bending(linear_question.experiment.structure.springs)
    return bandwidth / bending if math.isfinite(bending) else 0.0, ANSWERED


def _figure(figure: LinearFigure, lifted: LiftedPeriod, loops: Sequence[OpenLoop]) -> tuple[float, int]:
    """The figure of a linear answer, not-a-number where there is none; and the reason, or `ANSWERED`."""
    if not figure.of_loops:
        if lifted.map.at_limit:
            return math.nan, AT_LIMIT
        poles = [pole for pole in lifted.poles if not pole.stays(lifted.map.seconds)]
        if not poles:
            return math.nan, NOTHING_DECAYS
        if figure.name == "damping":
            return min(pole.damping for pole in poles), ANSWERED
        return max(math.inf if pole.s.real > 0.0 else pole.seconds for pole in poles), ANSWERED
    if any(loop.unstable for loop in loops):
        return figure.unstable, ANSWERED
    if not all(loop.returns for loop in loops):
        return math.nan, OPEN
    if figure.name == "gain_margin":
        room = [1.0 / down for down, _ in (loop.gains for loop in loops) if down]
        above = [loop.searched if loop.gains[1] is None else loop.gains[1] for loop in loops]
        return min([*room, *(limit for limit in above if limit is not None)], default=math.inf), ANSWERED
    single = [loop for loop in loops if len(loop.paths) == 1]
    if any(loop.margins is None for loop in single):
        return math.nan, SEVERAL_TICKS
    values = [getattr(loop.margins, figure.name.removesuffix("_margin")) for loop in single]
    return min((math.inf if value is None else value for value in values), default=math.inf), ANSWERED
