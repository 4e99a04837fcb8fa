"""The XML files of an FMU: its description, and how its sources are compiled."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from xml.sax.saxutils import quoteattr

from batch.fmu.variables import FmuVariable
from met.frozen import frozen
from met.plan import Experiment
from met.unit_parser import parse_unit
from met.version import VERSION

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
