"""Variables of an FMU: the coordinates of an experiment, the seeds of its noise, recorded channels, and metrics."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np

from batch.modules.description import described_columns
from met.frozen import frozen
from met.parameter import Parameter
from met.plan import REPEAT, Coordinate, Experiment
from met.plan.defaults import declared
from met.plan.outputs import metric_units
from met.program.build import METRIC
from met.run import inputs

Kind = Literal["parameter", "input", "output", "local"]

BELOW_SEED = 2.0**32
"""Upper bound of repeats and seeds."""

WRENCH = ("force", "moment")
"""Parameters of the environment model `wrench` that may change during a run."""


@frozen
class Variable:
    """One variable of an FMU, a double.

    kind      parameter: set before the run;  input: may change at every step;  output: recorded;  local: a metric
    source    its name in the program: of an input or an output; of a recorded channel its column
    unit      SI, as MET writes it;  shown, scale: as the deck writes it, where shown = value / scale
    start     where it is set from outside, else None
    low, high bounds that are included
    whole     whether it takes whole numbers alone
    """

    name: str
    kind: Kind
    source: str | int
    unit: str
    description: str
    start: float | None = None
    low: float = -math.inf
    high: float = math.inf
    whole: bool = False
    shown: str = ""
    scale: float = 1.0


def changing(experiment: Experiment) -> tuple[str, ...]:
    """The coordinates that may change during a run, by path: values of constant commands, forces and moments of
    wrenches."""
    structure = experiment.structure
    constant = {
        f"{use.joint}.servo.command.value"
        for use in structure.servos
        if use.command is not None and (use.command.model, use.command.guide) == ("constant", "")
    }
    wrenches = {
        f"environment.{use.name}.{vector}.{axis}"
        for use in structure.environment
        if use.model == "wrench"
        for vector in WRENCH
        for axis in "xyz"
    }
    free = constant | wrenches
    return tuple(c.path for c in experiment.cases.coordinates if c.sets and free.issuperset(c.sets))


def variables(experiment: Experiment) -> tuple[Variable, ...]:
    """All variables, in the order of their value references, which count from 1."""
    taken = {"time"}
    found = []
    for each in (*_outputs(experiment), *_metrics(experiment), *_settable(experiment)):
        name = each.name if each.name not in taken else f"coordinates.{each.name}"
        taken.add(name)
        found.append(each if name == each.name else Variable(**{**vars(each), "name": name}))
    order: tuple[Kind, ...] = ("parameter", "input", "output", "local")
    return tuple(sorted(found, key=lambda each: order.index(each.kind)))


def _settable(experiment: Experiment) -> Iterator[Variable]:
    cases = experiment.cases
    first = inputs(experiment, np.zeros(1, dtype=np.int64))[0].tolist()
    held = {path: parameter for path, _, _, parameter in declared(experiment) if parameter is not None}
    moving = changing(experiment)
    for coordinate, start in zip(cases.coordinates, first, strict=False):
        parameters = [held[path] for path in coordinate.sets if path in held]
        yield Variable(
            coordinate.path,
            "input" if coordinate.path in moving else "parameter",
            coordinate.path,
            _si_unit(experiment, coordinate),
            parameters[0].doc if parameters else "",
            start,
            max((_low(each) for each in parameters), default=-math.inf),
            min((_high(each) for each in parameters), default=math.inf),
            any(each.whole for each in parameters),
            coordinate.unit,
            coordinate.scale,
        )
    for name, start in zip(cases.noise, first[len(cases.coordinates) :], strict=True):
        what = "number of the repeat, which has noise of its own" if name == REPEAT else "seed of the noise"
        yield Variable(name, "parameter", name, "1", what, start, 0.0, BELOW_SEED - 1.0, True)


def _si_unit(experiment: Experiment, coordinate: Coordinate) -> str:
    """The SI unit of a coordinate: that of the first parameter that it sets."""
    units = [experiment.parameters[path].unit for path in coordinate.sets if path in experiment.parameters]
    return units[0] if units else "1"


def _low(parameter: Parameter) -> float:
    least = -math.inf if parameter.at_least is None else parameter.at_least
    return least if parameter.above is None else max(least, math.nextafter(parameter.above, math.inf))


def _high(parameter: Parameter) -> float:
    most = math.inf if parameter.at_most is None else parameter.at_most
    return most if parameter.below is None else min(most, math.nextafter(parameter.below, -math.inf))


def _outputs(experiment: Experiment) -> Iterator[Variable]:
    docs = {each.name: each.doc for each in experiment.structure.record}
    for column, each in enumerate(described_columns(experiment)):
        yield Variable(each["channel"], "output", column, each["unit"], docs[each["signal"]])


def _metrics(experiment: Experiment) -> Iterator[Variable]:
    units = metric_units(experiment.structure)
    for use in experiment.structure.metrics:
        what = f"metric {use.model} of {use.of}, as if the run ended here"
        yield Variable(f"metrics.{use.name}", "local", METRIC + use.name, units[use.name], what)
