"""Where a value comes from: `elbow.servo.kt`, its unit, who wrote it, what that overrode, through which macros."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from ic.printing.columns import columns, number, quantity, vector
from met import models, render
from met.diagnostic import Diagnostic, Label, Place, Problem, error
from met.models import parameter as declared
from met.parameter import Parameter
from met.plan import Coordinate, Experiment, Formula, Quantity

SAID = {
    "deck": "written here",
    "case": "a sweep varies it, here",
    "default": "the default",
    "derived": "computed",
}
MOST_NEAR = 12
MOST_IN_FULL = 3  # parameters; of more a line each


def find_paths(experiment: Experiment, path: str) -> list[str]:
    """The parameters that a deck's path means. Raises Problem D170 with what was probably meant.

    A path is one parameter (`elbow.servo.kt`), a vector of three (`elbow.at`), a servo's definition with one of its
    parameters (`gearbox.kp`, then each joint that uses it), or the head of several (`elbow.servo`).
    """
    known = experiment.parameters
    if path in known:
        return [path]
    inside = [name for name in known if name.startswith(f"{path}.")]
    if inside:
        return inside
    definition, _, rest = path.partition(".")
    joints = [use.joint for use in experiment.structure.servos if use.definition == definition]
    found = [name for joint in joints for name in (f"{joint}.servo.{rest}",) if name in known]
    if found:
        return found
    near = difflib.get_close_matches(path, known, n=3, cutoff=0.6)
    helps = [f"did you mean `{'`, `'.join(near)}`?"] if near else []
    last = path.rpartition(".")[2]
    same = [name for name in known if name.rpartition(".")[2] == last and name not in near]
    if same:
        more = f" and {len(same) - MOST_NEAR} more" if len(same) > MOST_NEAR else ""
        helps.append(f"parameters called `{last}`: {', '.join(same[:MOST_NEAR])}{more}")
    if not helps:
        heads = dict.fromkeys(name.partition(".")[0] for name in known)
        helps.append(f"paths begin with {', '.join(heads)}")
    raise Problem(error("D170", f"no parameter `{path}` in `{experiment.name}`", help=helps))


Names = Callable[[str], tuple[Label, ...]]


def print_explain(experiment: Experiment, path: str, sources: Mapping[str, str], names_of: Names) -> Iterator[str]:
    """Line by line, parameter by parameter.

    sources    text of each file by name
    names_of   of a parameter, the names that its value is written with, each with what it stands for
    """
    names = find_paths(experiment, path)
    if len(names) > MOST_IN_FULL:
        yield from columns([_in_short(experiment, name) for name in names], indent="")
        return
    if _is_vector(experiment, names):
        yield from _one(experiment, names, sources, names_of(names[0]))
        return
    for position, name in enumerate(names):
        if position:
            yield ""
        yield from _one(experiment, [name], sources, names_of(name))


def explain_json(experiment: Experiment, path: str) -> list[dict[str, Any]]:
    """The same for programs, values in SI."""
    told = []
    for name in find_paths(experiment, path):
        found = experiment.parameters[name]
        varied = isinstance(found.value, Formula)
        told.append(
            {
                "path": name,
                "value": _values(experiment, found).tolist() if varied else found.value,
                "varies": varied,
                "unit": found.unit,
                "origin": found.origin.kind,
                "note": found.origin.note,
                "place": _place_json(found.origin.place),
                "overrides": [_place_json(place) for place in found.origin.overrides],
            }
        )
    return told


def _in_short(experiment: Experiment, name: str) -> tuple[str, ...]:
    found = experiment.parameters[name]
    place = found.origin.place
    said = found.origin.note or SAID[found.origin.kind].removesuffix(" here").rstrip(",")
    return name, f"= {_shown(experiment, found)}", said, "" if place is None else str(render.shown_place(place))


def _is_vector(experiment: Experiment, names: list[str]) -> bool:
    """Whether these are the three parts of a vector that was written at once."""
    found = [experiment.parameters[name] for name in names]
    together = [name.rpartition(".")[2] for name in names] == ["x", "y", "z"]
    return together and all(isinstance(q.value, float) and q.origin == found[0].origin for q in found)


def _one(
    experiment: Experiment, names: list[str], sources: Mapping[str, str], used: tuple[Label, ...]
) -> Iterator[str]:
    """A parameter, or the three of a vector."""
    name = names[0]
    found = experiment.parameters[name]
    origin = found.origin
    if len(names) > 1:
        parts = [experiment.parameters[each].value for each in names]
        yield f"{name.rpartition('.')[0]} = {vector([part for part in parts if isinstance(part, float)], found.unit)}"
    else:
        yield f"{name} = {_shown(experiment, found)}"
    parameter, owner = _declaration(experiment, name)
    if parameter is not None:
        source = f"; {parameter.source}" if parameter.source else ""
        yield f"  {parameter.doc} ({owner}{source})"
    for coordinate in _varied_by(experiment, name):
        unit = "" if coordinate.unit == "1" else f" {coordinate.unit}"
        yield f"  varied by {coordinate.path}: {_series(coordinate.values / coordinate.scale)}{unit}"
    note = "" if parameter is not None and origin.note == parameter.source else origin.note
    said = SAID[origin.kind] + (f": {note}" if note else "")
    if origin.place is None:
        yield f"  {said}"
        return
    also = (*used, *(Label(place, "overrides this") for place in origin.overrides))
    yield from _with_source(origin.place, said, also, sources)


def _with_source(place: Place, said: str, also: tuple[Label, ...], sources: Mapping[str, str]) -> Iterator[str]:
    """The place with its line, macros and includes, as a diagnostic shows them, without head and count."""
    text = render.render([Diagnostic("", "", Label(place, said), also, severity="note")], sources)
    yield from text.splitlines()[1:-2]


def _shown(experiment: Experiment, found: Quantity) -> str:
    match found.value:
        case str():
            return found.value
        case tuple():
            return vector(found.value, found.unit)
        case Formula():
            values = _values(experiment, found)
            low, high = float(values.min()), float(values.max())
            return f"{number(low)} to {quantity(high, found.unit)}, varies with the case"
        case float() | int():
            return quantity(found.value, found.unit)
    raise AssertionError(found)


def _values(experiment: Experiment, found: Quantity) -> np.ndarray:
    assert isinstance(found.value, Formula)
    inputs = {coordinate.path: coordinate.values for coordinate in experiment.cases.coordinates}
    return np.asarray(experiment.formulas.replay(inputs)[found.value.output], dtype=float)


def _varied_by(experiment: Experiment, name: str) -> list[Coordinate]:
    return [coordinate for coordinate in experiment.cases.coordinates if name in coordinate.sets]


def _series(values: np.ndarray) -> str:
    shown = [number(float(value)) for value in dict.fromkeys(values.tolist())]
    return ", ".join(shown) if len(shown) <= 8 else f"{shown[0]}, {shown[1]} ... {shown[-1]} ({len(shown)} values)"


def _declaration(experiment: Experiment, name: str) -> tuple[Parameter | None, str]:
    """What the model declares of this parameter, and which model that is."""
    structure = experiment.structure
    words = name.split(".")
    model: Any = None
    for use in structure.servos:
        if name.startswith(f"{use.joint}.servo.command.") and use.command is not None:
            model, own = models.find("command", use.command.model), words[len(use.joint.split(".")) + 2]
        elif name.startswith(f"{use.joint}.servo."):
            model, own = models.find("servo", use.model), words[len(use.joint.split(".")) + 1]
    for environment in structure.environment:
        if name.startswith(f"environment.{environment.name}."):
            model, own = models.find("environment", environment.model), words[2]
    for metric in structure.metrics:
        if name.startswith(f"metrics.{metric.name}."):
            model, own = models.find("metric", metric.model), words[2]
    return (None, "") if model is None else (declared(model, own), f"{model.name}")


def _place_json(place: Place | None) -> dict[str, Any] | None:
    if place is None:
        return None
    steps = [{"macro": step.macro, "use": _place_json(step.use)} for step in place.expansions]
    return {"file": place.file, "line": place.line, "column": place.column, "length": place.length, "expansions": steps}
