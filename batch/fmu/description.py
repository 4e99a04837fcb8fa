"""The XML files of an FMU: its description, and how its sources are compiled."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from xml.sax.saxutils import quoteattr

from batch.fmu.variables import Variable
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
    lines = [f"  {line}" for each in inside for line in each.split("\n")]
    return "\n".join([f"<{name}{words}>", *lines, f"</{name}>"]) if lines else f"<{name}{words}/>"


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value) if isinstance(value, float) else str(value)


def unit_name(unit: str) -> str:
    """A unit of MET in the form that other tools write: `N.m`, `kg.m2`; "" for a pure number."""
    return "" if unit == "1" else unit.replace("*", ".").replace("^", "")


def model_description(experiment: Experiment, variables: Sequence[Variable], naming: Naming) -> str:
    """The text of modelDescription.xml in FMI 3.0."""
    schedule = experiment.structure.schedule
    step = schedule.dynamics / schedule.base_hz
    references = {each.name: number for number, each in enumerate(variables, start=1)}
    outputs = [{"valueReference": references[each.name]} for each in variables if each.kind == "output"]
    abilities = ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUState", "canSerializeFMUState")
    attributes = {
        "fmiVersion": "3.0",
        "modelName": naming.model,
        "instantiationToken": naming.token,
        "description": _summary(schedule.base_hz),
        "generationTool": f"{TOOL}{VERSION}",
        "variableNamingConvention": "flat",
    }
    time = {"name": "time", "valueReference": 0, "causality": "independent", "variability": "continuous", "unit": "s"}
    parts = [
        element(
            "CoSimulation",
            {
                "modelIdentifier": naming.identifier,
                **dict.fromkeys(abilities, True),
                "fixedInternalStepSize": step,
            },
        ),
        element("UnitDefinitions", {}, _units(variables)),
        element("LogCategories", {}, [element("Category", {"name": "logStatusError", "description": "wrong calls"})]),
        element(
            "DefaultExperiment",
            {
                "startTime": 0.0,
                "stopTime": schedule.ticks / schedule.base_hz,
                "stepSize": schedule.record / schedule.base_hz,
            },
        ),
        element(
            "ModelVariables",
            {},
            [element("Float64", time), *(_variable(each, references[each.name]) for each in variables)],
        ),
        element(
            "ModelStructure",
            {},
            [element(kind, each) for kind in ("Output", "InitialUnknown") for each in outputs],
        ),
    ]
    return f"{HEAD}{element('fmiModelDescription', attributes, parts)}\n"


def build_description(naming: Naming, options: Sequence[str]) -> str:
    """The text of sources/buildDescription.xml in FMI 3.0. options: of a C compiler"""
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


def _variable(variable: Variable, reference: int) -> str:
    settable = variable.start is not None
    bounds = {"min": variable.low, "max": variable.high}
    scaled = settable and variable.scale != 1.0
    return element(
        "Float64",
        {
            "name": variable.name,
            "valueReference": reference,
            "description": variable.description,
            "causality": variable.kind,
            "variability": "fixed" if variable.kind == "parameter" else "continuous",
            "initial": None if settable else "calculated",
            "unit": unit_name(variable.unit),
            "displayUnit": unit_name(variable.shown) if scaled else None,
            **{key: value for key, value in bounds.items() if math.isfinite(value)},
            "start": variable.start,
        },
    )


def _units(variables: Sequence[Variable]) -> Iterator[str]:
    """Each unit, with those in which the deck writes its values."""
    shown: dict[str, dict[str, float]] = {"s": {}}
    for each in variables:
        if each.unit != "1":
            of_unit = shown.setdefault(each.unit, {})
            if each.start is not None and each.scale != 1.0:
                of_unit[each.shown] = 1.0 / each.scale
    for unit, displays in sorted(shown.items()):
        measure = parse_unit(unit)
        exponents = {name: power for name, power in measure.dimension._asdict().items() if power}
        yield element(
            "Unit",
            {"name": unit_name(unit)},
            [
                element("BaseUnit", exponents),
                *(element("DisplayUnit", {"name": unit_name(n), "factor": f}) for n, f in sorted(displays.items())),
            ],
        )
