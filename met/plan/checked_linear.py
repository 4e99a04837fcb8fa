"""Checks of a plan's linear answers, and of metrics of them, that its types cannot make. All raise `Damaged`."""

from __future__ import annotations

import math

from met.plan import Experiment, Structure
from met.plan.channel import recordable
from met.plan.codec import Damaged
from met.plan.linear_signals import input_signals
from met.plan.linear_uses import FIGURES, LinearUse
from met.plan.structure import check_name

MOST_SIGNALS = 1000
"""Largest number of inputs, outputs and opened places of one answer, of each kind."""


def is_way(use: LinearUse, structure: Structure) -> bool:
    """True for an answer with one input and one output, both of one number."""
    known = recordable(structure, use.outputs)
    return len(use.inputs) == 1 == sum(len(variable.channels) for path in use.outputs for variable in known[path])


def check_linear(experiment: Experiment, where: str) -> None:
    """Check that every answer is about signals of the run, at an instant of it, and that every metric is a figure of
    one."""
    structure, names = experiment.structure, list[str]()
    known = {input_signal.path: input_signal for input_signal in input_signals(structure)} if experiment.linear else {}
    for index, use in enumerate(experiment.linear):
        place = f"{where}.linear[{index}]"
        check_name(use.name, f"{place}.name", names)
        names.append(use.name)
        if not 0.0 <= use.at <= structure.schedule.duration:
            raise Damaged(f"{place}.at", f"it should be between 0 and {structure.schedule.duration:g} s")
        if use.pose and len(use.pose) != len(structure.independent):
            raise Damaged(f"{place}.pose", f"it should be of {len(structure.independent)} joints")
        if use.pose is not None and (use.at != 0.0 or not all(map(math.isfinite, use.pose))):
            raise Damaged(f"{place}.pose", "its numbers should be finite, and the instant 0")
        for field, paths in (("inputs", use.inputs), ("opened", use.opened), ("outputs", use.outputs)):
            if len(paths) > MOST_SIGNALS or len(set(paths)) < len(paths):
                raise Damaged(f"{place}.{field}", "something is there twice, or too much")
        recorded = recordable(structure, use.outputs)
        for path in use.outputs:
            if path not in recorded:
                raise Damaged(f"{place}.outputs", f"there is no channel `{path}`")
        for path in (*use.inputs, *use.opened):
            if path not in known or (path in use.opened and not known[path].is_output):
                raise Damaged(f"{place}.{'opened' if path in use.opened else 'inputs'}", f"`{path}` is none")
    answers = {use.name: use for use in experiment.linear}
    taken = [use.name for use in structure.metrics]
    for index, metric in enumerate(experiment.linear_metrics):
        place = f"{where}.linear_metrics[{index}]"
        check_name(metric.name, f"{place}.name", taken)
        taken.append(metric.name)
        if metric.model not in FIGURES:
            raise Damaged(f"{place}.model", f"there is no figure `{metric.model}`")
        if metric.of not in answers:
            raise Damaged(f"{place}.of", f"there is no `{metric.of}` among the linear answers")
        if FIGURES[metric.model].of_loops and not answers[metric.of].opened:
            raise Damaged(f"{place}.of", f"`{metric.of}` opens no loop")
        if FIGURES[metric.model].of_way and not is_way(answers[metric.of], structure):
            raise Damaged(f"{place}.of", f"`{metric.of}` has not one input and one output")
