"""Variables of an FMU: the coordinates of an experiment, the seeds of its noise, recorded channels, and metrics; and
the XML files that describe them, and how the sources are compiled.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal
from xml.sax.saxutils import quoteattr

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
from met.unit_parser import parse_unit
from met.version import VERSION

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


TOOL = "MET "
"""Begin of the name of the tool that wrote an FMU; the version follows."""

HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'


@frozen
class Naming:
    """Names of an FMU: of its model, of its binary, and the token by which a master knows that both belong together."""

    model: str
    identifier: str
    token: str


def element(name: str, attributes: Mapping[str, object], inside: Iterable[str] = ()) -> str:
    """An XML element. attributes: those that are None or empty are left out; doubles are exact."""
    words = "".join(
        f" {key}={quoteattr(_text(value))}" for key, value in attributes.items() if value is not None and value != ""
    )
    lines = [f"  {line}" for text in inside for line in text.split("\n")]
    return "\n".join([f"<{name}{words}>", *lines, f"</{name}>"]) if lines else f"<{name}{words}/>"


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value) if isinstance(value, float) else str(value)


def unit_name(unit: str) -> str:
    """A unit of MET in the form that other tools write: `N.m`, `kg.m2`; "" for a pure number."""
    return "" if unit == "1" else unit.replace("*", ".").replace("^", "")


def model_description(experiment: Experiment, variables: Sequence[FmuVariable], naming: Naming, version: int) -> str:
    """The text of modelDescription.xml. version: of FMI, 2 or 3"""
    schedule = experiment.structure.schedule
    numbered = list(enumerate(variables, start=1))
    outputs = [number for number, variable in numbered if variable.kind == "output"]
    attributes = {
        "fmiVersion": f"{version}.0",
        "modelName": naming.model,
        "instantiationToken" if version == 3 else "guid": naming.token,
        "description": _summary(schedule.base_hz),
        "generationTool": f"{TOOL}{VERSION}",
        "variableNamingConvention": "flat",
    }
    experiment_times = {
        "startTime": 0.0,
        "stopTime": schedule.ticks / schedule.base_hz,
        "stepSize": schedule.record / schedule.base_hz,
    }
    write = _variable if version == 3 else _scalar_variable
    parts = [
        _co_simulation(naming, version, schedule.dynamics / schedule.base_hz),
        element("UnitDefinitions", {}, _units(variables)),
        element("LogCategories", {}, [element("Category", {"name": "logStatusError", "description": "wrong calls"})]),
        element("DefaultExperiment", experiment_times),
        element(
            "ModelVariables",
            {},
            [
                *([element("Float64", TIME)] if version == 3 else []),
                *(write(variable, number) for number, variable in numbered),
                *([_scalar_time()] if version == 2 and not numbered else []),
            ],
        ),
        element("ModelStructure", {}, _structure(outputs, version)),
    ]
    return f"{HEAD}{element('fmiModelDescription', attributes, parts)}\n"


TIME = {"name": "time", "valueReference": 0, "causality": "independent", "variability": "continuous", "unit": "s"}
"""The variable that FMI 3.0 asks for besides those of the model."""


def _scalar_time() -> str:
    """Time as a variable of FMI 2.0, which asks for one variable at least."""
    unit = TIME["unit"]
    words = {name: word for name, word in TIME.items() if name != "unit"}
    return element("ScalarVariable", words, [element("Real", {"unit": unit})])


def _co_simulation(naming: Naming, version: int, step: float) -> str:
    """The XML element of the abilities of an FMU for co-simulation. step: of the dynamics, s"""
    state = "State" if version == 3 else "state"
    abilities = ("canHandleVariableCommunicationStepSize", f"canGetAndSetFMU{state}", f"canSerializeFMU{state}")
    attributes = {"modelIdentifier": naming.identifier, **dict.fromkeys(abilities, True)}
    if version == 3:
        return element("CoSimulation", {**attributes, "fixedInternalStepSize": step})
    return element("CoSimulation", attributes, [element("SourceFiles", {}, [element("File", {"name": "fmi2.c"})])])


def _structure(outputs: Sequence[int], version: int) -> list[str]:
    """The variables that depend on others: numbers of the outputs."""
    kinds = ("Output", "InitialUnknown")
    if version == 3:
        return [element(kind, {"valueReference": number}) for kind in kinds for number in outputs]
    listed = [element("Unknown", {"index": number}) for number in outputs]
    return [element(f"{kind}s", {}, listed) for kind in kinds if listed]


def build_description(naming: Naming, options: Sequence[str]) -> str:
    """The text of sources/buildDescription.xml, which FMI 3.0 asks for. options: of a C compiler"""
    source = element("SourceFile", {"name": "fmi3.c"})
    files = element("SourceFileSet", {"language": "C11", "compilerOptions": " ".join(options)}, [source])
    build = element("BuildConfiguration", {"modelIdentifier": naming.identifier}, [files])
    return f"{HEAD}{element('fmiBuildDescription', {'fmiVersion': '3.0'}, [build])}\n"


def _summary(base_hz: float) -> str:
    """The meaning of communication steps, for those who use the FMU."""
    return (
        f"Ticks of {1.0 / base_hz:g} s from the start. Inputs act from the tick at which they are set. Outputs at a "
        "communication point are those of the tick there, or of the last tick before it."
    )


def _variable(variable: FmuVariable, reference: int) -> str:
    return element("Float64", {**_head(variable, reference), **_type(variable)})


def _scalar_variable(variable: FmuVariable, reference: int) -> str:
    return element("ScalarVariable", _head(variable, reference), [element("Real", _type(variable))])


def _head(variable: FmuVariable, reference: int) -> dict[str, object]:
    """The attributes of a variable of an FMU's description. reference: its number"""
    return {
        "name": variable.name,
        "valueReference": reference,
        "description": variable.description,
        "causality": variable.kind,
        "variability": "fixed" if variable.kind == "parameter" else "continuous",
        "initial": "calculated" if variable.start is None else None,
    }


def _type(variable: FmuVariable) -> dict[str, object]:
    """The attributes of a real variable: units, bounds and start."""
    bounds = {"min": variable.low, "max": variable.high}
    return {
        "unit": unit_name(variable.unit),
        "displayUnit": unit_name(variable.display) if has_display(variable) else None,
        **{key: value for key, value in bounds.items() if math.isfinite(value)},
        "start": variable.start,
    }


def has_display(variable: FmuVariable) -> bool:
    """True where the deck writes a variable in a unit of its own."""
    return variable.start is not None and variable.scale != 1.0 and variable.unit != "1"


def _units(variables: Sequence[FmuVariable]) -> Iterator[str]:
    """Each unit, with those in which the deck writes its values."""
    displays: dict[str, dict[str, float]] = {"s": {}}
    for variable in variables:
        if variable.unit != "1":
            factors = displays.setdefault(variable.unit, {})
            if has_display(variable):
                factors[variable.display] = 1.0 / variable.scale
    for unit, factors in sorted(displays.items()):
        exponents = {name: power for name, power in parse_unit(unit).dimension._asdict().items() if power}
        display_units = [
            element("DisplayUnit", {"name": unit_name(name), "factor": factor})
            for name, factor in sorted(factors.items())
        ]
        yield element("Unit", {"name": unit_name(unit)}, [element("BaseUnit", exponents), *display_units])
