"""Variables of an FMU: the coordinates of an experiment, the seeds of its noise, recorded channels, and metrics."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Literal

import numpy as np

from batch.archive.layout import coordinate_unit
from batch.modules.description import described_columns
from met.frozen import frozen
from met.parameter import Parameter
from met.plan import REPEAT, SEED, Coordinate, Experiment, Formula
from met.plan.defaults import declared
from met.plan.outputs import metric_units
from met.program.build import METRIC
from met.run import inputs

Kind = Literal["parameter", "input", "output", "local"]

NOISE = {
    REPEAT: ("number of the repeat, which has noise of its own", 2.0**32 - 1.0),
    SEED: ("seed of the noise", 2.0**53 - 1.0),
}
"""Descriptions and largest values of a case's inputs for its noise, by their names."""

WRENCH = ("force", "moment")
"""Parameters of the environment model `wrench` that may change during a run."""


@frozen
class FmuVariable:
    """One variable of an FMU, a double.

    kind      parameter: set before the run;  input: may change at every step;  output: recorded;  local: a metric
    source    its name in the program: of an input or an output; of a recorded channel its column
    unit      SI, as MET writes it;  display, scale: the deck's, where display = value / scale
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
    display: str = ""
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
    coordinates = experiment.cases.coordinates
    return tuple(coord.path for coord in coordinates if coord.sets and free.issuperset(coord.sets))


def variables(experiment: Experiment) -> tuple[FmuVariable, ...]:
    """All variables, in the order of their value references, which count from 1."""
    listed: dict[str, FmuVariable] = {}
    for variable in (*_outputs(experiment), *_metrics(experiment), *_settable(experiment)):
        clashes = variable.name in listed or variable.name == "time"
        name = f"coordinates.{variable.name}" if clashes else variable.name
        listed[name] = replace(variable, name=name)
    order: tuple[Kind, ...] = ("parameter", "input", "output", "local")
    return tuple(sorted(listed.values(), key=lambda variable: order.index(variable.kind)))


def _settable(experiment: Experiment) -> Iterator[FmuVariable]:
    """The variables that are set from outside, in the order of the program's inputs."""
    cases = experiment.cases
    starts = inputs(experiment, np.zeros(1, dtype=np.int64))[0].tolist()
    declarations = {path: parameter for path, _, _, parameter in declared(experiment) if parameter is not None}
    inputs_of_fmu = changing(experiment)
    for coordinate, start in zip(cases.coordinates, starts, strict=False):
        paths = list(_equals(experiment, coordinate))
        parameters = [declarations[path] for path in paths if path in declarations]
        least = [0.0 for path in paths if path.startswith(("links.", "payloads.")) and path.endswith(".mass")]
        yield FmuVariable(
            coordinate.path,
            "input" if coordinate.path in inputs_of_fmu else "parameter",
            coordinate.path,
            coordinate_unit(experiment, coordinate),
            parameters[0].doc if parameters else "",
            start,
            max([*map(_low, parameters), *least], default=-math.inf),
            min(map(_high, parameters), default=math.inf),
            any(parameter.whole for parameter in parameters),
            coordinate.unit,
            coordinate.scale,
        )
    for name, start in zip(cases.noise, starts[len(cases.coordinates) :], strict=True):
        what, most = NOISE[name]
        yield FmuVariable(name, "parameter", name, "1", what, start, 0.0, most, True)


def _equals(experiment: Experiment, coordinate: Coordinate) -> Iterator[str]:
    """The parameters that are a coordinate's value itself, by path, and not computed from it."""
    formulas = experiment.formulas
    for path in coordinate.sets:
        value = experiment.parameters[path].value
        if isinstance(value, Formula):
            reference = formulas.outputs[value.output]
            if not reference & 1 and formulas.nodes[reference >> 1] == ("input", coordinate.path):
                yield path


def _low(parameter: Parameter) -> float:
    least = -math.inf if parameter.at_least is None else parameter.at_least
    return least if parameter.above is None else max(least, math.nextafter(parameter.above, math.inf))


def _high(parameter: Parameter) -> float:
    most = math.inf if parameter.at_most is None else parameter.at_most
    return most if parameter.below is None else min(most, math.nextafter(parameter.below, -math.inf))


def _outputs(experiment: Experiment) -> Iterator[FmuVariable]:
    docs = {recorded.name: recorded.doc for recorded in experiment.structure.record}
    for number, column in enumerate(described_columns(experiment)):
        yield FmuVariable(column["channel"], "output", number, column["unit"], docs[column["signal"]])


def _metrics(experiment: Experiment) -> Iterator[FmuVariable]:
    """The metrics as variables of an FMU, as if the run ended now."""
    units = metric_units(experiment.structure)
    for use in experiment.structure.metrics:
        what = f"metric {use.model} of {use.of}, as if the run ended here"
        yield FmuVariable(f"metrics.{use.name}", "local", METRIC + use.name, units[use.name], what)
