"""Checks of a plan's linear answers and of its search that its types cannot make. All raise `Damaged`."""

from __future__ import annotations

import math

from met.plan import Experiment, Structure
from met.plan.channel import recordable
from met.plan.codec import Damaged
from met.plan.judged import FIGURES, LinearUse
from met.plan.linear_signals import input_signals
from met.plan.searches import MOST_PLANTS, MOST_SEARCHED, SHORTEST, Search, are_starts
from met.plan.structure import check_name, check_whole
from met.unit_parser import parse_unit

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


MOST_SEED = 2**53


def check_search(experiment: Experiment, search: Search, where: str) -> None:
    """Check that a search fits its run: its goal is a metric, its parameters and its plants (the cases that a tuning
    judges candidates on) are the coordinates, and its generations make up the case table. Raises Damaged."""
    if search.metric not in {use.name for use in experiment.metrics}:
        raise Damaged(f"{where}.metric", f"there is no metric `{search.metric}`")
    check_whole(search.at_most, 1, MOST_SEARCHED, f"{where}.at_most")
    check_whole(search.seed, 0, MOST_SEED, f"{where}.seed")
    check_whole(search.drawn_with, 0, MOST_SEED, f"{where}.drawn_with")
    if not 0.0 <= search.margin < 1.0:
        raise Damaged(f"{where}.margin", "it should be at least 0 and below 1")
    if not 0.0 <= search.least_margin < 2.0:
        raise Damaged(f"{where}.least_margin", "it should be at least 0 and below 2")
    if search.judged and not (search.kind == "tune" and search.complete):
        raise Damaged(f"{where}.judged", "a tuning alone that has run has judged designs")
    for index, design in enumerate(search.judged):
        check_whole(design.case, 0, experiment.cases.count - 1, f"{where}.judged[{index}].case")
    if search.starts and not (search.kind == "tune" and search.complete):
        raise Damaged(f"{where}.starts", "a tuning alone that has run has starts")
    if not are_starts(search.starts, experiment.cases.count):
        raise Damaged(f"{where}.starts", "they should rise, and lie among the cases")
    if search.confirmation and not (search.fresh and search.complete):
        raise Damaged(f"{where}.confirmation", "a tuning alone that has run is confirmed, by cases that it has")
    for confirmation in search.confirmation:
        check_whole(confirmation.cases, len(search.fresh), len(search.fresh), f"{where}.confirmation.cases")
        check_whole(confirmation.failed, 0, confirmation.cases, f"{where}.confirmation.failed")
        check_whole(confirmation.missed, 0, confirmation.cases - confirmation.failed, f"{where}.confirmation.missed")
    check_whole(search.along_slopes, 0, search.at_most, f"{where}.along_slopes")
    if search.gradients and search.kind != "tune":
        raise Damaged(f"{where}.gradients", "a tuning alone goes by slopes")
    if (search.along_slopes or search.without_slopes) and not (search.gradients and search.complete):
        raise Damaged(f"{where}.along_slopes", "a tuning alone that has run by slopes says so")
    _check_parameters(experiment, search, f"{where}.parameters")
    _check_plants(experiment, search, f"{where}.plants")
    if search.complete:
        for index, count in enumerate(search.generations):
            check_whole(count, 1, MOST_SEARCHED, f"{where}.generations[{index}]")
        if sum(search.generations) != experiment.cases.count:
            raise Damaged(f"{where}.generations", f"they are not of the {experiment.cases.count} cases")
    if experiment.cases.count > search.budget:
        raise Damaged(f"{where}.at_most", f"there are {experiment.cases.count} cases")
    cases = experiment.cases
    if cases.choices or cases.repeats is not None or cases.positions is not None or cases.seeds != "common":
        raise Damaged(where, "its cases should be of one structure, without repeats, and feel the same noise")


def _check_parameters(experiment: Experiment, search: Search, where: str) -> None:
    """Check that a search's parameters are the first coordinates of its cases, and have ends that can be searched.
    Raises Damaged."""
    paths = [coordinate.path for coordinate in experiment.cases.coordinates]
    if not search.parameters:
        raise Damaged(where, "there is none")
    for index, parameter in enumerate(search.parameters):
        if index >= len(paths) or parameter.path != paths[index]:
            raise Damaged(f"{where}[{index}].path", f"`{parameter.path}` is not coordinate {index} of the cases")
        if not -math.inf < parameter.low < parameter.high < math.inf:
            raise Damaged(f"{where}[{index}].low", "the ends should be finite, and rise")
        if parameter.high - parameter.low == math.inf:
            raise Damaged(f"{where}[{index}].low", "the ends are too far apart")
        if parameter.logarithmic and not (parameter.low > 0.0 or parameter.high < 0.0):
            raise Damaged(f"{where}[{index}].low", "both ends should be above or below 0")
        try:
            if parameter.unit:
                parse_unit(parameter.unit)
        except ValueError as reason:
            raise Damaged(f"{where}[{index}].unit", f"{parameter.unit!r} is no unit") from reason


def _check_plants(experiment: Experiment, search: Search, where: str) -> None:
    """Check the plants of a tuning, which are the cases of the sweep that it judges candidates on: each has one finite
    number for each coordinate that is not chosen. Raises Damaged."""
    more = len(experiment.cases.coordinates) - len(search.parameters)
    if bool(search.plants) != bool(search.against) or bool(search.plants) != (more > 0):
        raise Damaged(where, "they should be of the coordinates that are not chosen, and of a sweep")
    if (search.plants or search.margin) and search.kind != "tune":
        raise Damaged(where, "a tuning alone is held against something")
    if bool(search.fresh) != bool(search.confirms) or (search.fresh and not search.plants):
        raise Damaged(f"{where[: -len('plants')]}fresh", "they should be of a sweep, beside the plants of another")
    check_whole(max(len(search.plants), len(search.fresh)), 0, MOST_PLANTS, where)
    for index, plant in enumerate((*search.plants, *search.fresh)):
        if len(plant) != more or not all(map(math.isfinite, plant)):
            raise Damaged(f"{where}[{index}]", f"it should be {more} finite numbers")
    if search.kind == "tune" and search.budget < len(search.plants) + SHORTEST:
        raise Damaged(
            f"{where[: -len('plants')]}at_most",
            f"it should be at least {len(search.plants) + len(search.fresh) + SHORTEST}",
        )
