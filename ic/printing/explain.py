"""The origin of a value as text: `elbow.servo.kt`, its unit, who wrote it, what that overrode, through which macros; in
each structure of a run or sweep, or in other runs where these do not have the path.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from ic.driver.compile import Compiled
from ic.driver.explain import explanations_of, with_all_settings
from ic.language import HEADS
from ic.language.unit_words import after_number
from ic.meaning.expressions.names import ON_COMMAND_LINE
from ic.printing.columns import columns, number, quantity, vector
from ic.printing.looked_up import is_code
from ic.printing.settings import settings
from ic.robots.entries import NOTES
from ic.text.complaints import known_words
from met import units
from met.diagnostic import Diagnostic, Label, Place, Problem, error, nearest
from met.frozen import frozen
from met.messages import render
from met.messages.message import shown_place
from met.models import parameter as declared
from met.parameter import Parameter
from met.plan import Coordinate, Experiment, Formula, Origin, Plan, Quantity
from met.plan.channel import recordable
from met.plan.columns import span
from met.plan.uses import model_uses
from met.substitution import bed_scale
from met.unit_parser import decimals, written

ORIGIN_WORDS = {
    "deck": "written here",
    "case": "a sweep varies it, here",
    "default": "the default",
    "derived": "computed",
}
IN_PLAN = "as the plan has it"
NO_MORE: Mapping[str, Sequence[str]] = MappingProxyType({})
MOST_NEAR = 12
MOST_LISTED = 12  # numbers of a list; of a longer one the ends
MOST_IN_FULL = 3  # parameters; of more a line each


def with_settings(experiment: Experiment) -> Experiment:
    """The experiment with the settings of its run as if they were parameters, so that they can be explained."""
    return replace(
        experiment,
        parameters={
            **experiment.parameters,
            **{path: quantity for path, quantity in settings(experiment).items() if path not in experiment.parameters},
        },
    )


def find_paths(experiment: Experiment, path: str, also: Mapping[str, Sequence[str]] = NO_MORE) -> list[str]:
    """The parameters of a deck's path. Raises Problem D170 with a similar path.

    also: further paths with the parameters that they mean.

    A path is one parameter (`elbow.servo.kt`), a vector of three (`elbow.at`), a servo's definition with one of its
    parameters (`gearbox.kp`, then each joint that uses it), or the head of several (`elbow.servo`). A definition alone
    (`gearbox`) means all that follows it, and a link or a metric may be named without `links.` or `metrics.`.
    """
    known = experiment.parameters
    if path in known:  # a word such as `elbow.servo` may be the head of others
        words = isinstance(known[path].value, str)
        return [path, *(name for name in known if words and name.startswith(f"{path}."))]
    gravity = path.replace("environment.gravity.", "environment.gravity.g.")
    meant = [name for name in also.get(path, [gravity]) if name in known]
    if meant:
        return meant
    inside = [name for name in known if name.startswith(f"{path}.")]
    if inside:
        return inside
    for head in HEADS:
        inside = [name for name in known if name == f"{head}.{path}" or name.startswith(f"{head}.{path}.")]
        if inside:
            return inside
    heads = dict.fromkeys(name.partition(".")[0] for name in known)
    if path == experiment.name or _is_run(path, also):
        raise Problem(
            error(
                "D170",
                f"`{path}` is a run or a sweep, and no parameter",
                help=[f"`met plan DECK {path}` prints it", f"paths begin with {', '.join(heads)}"],
            )
        )
    follow = [name for owner, names in also.items() if owner.startswith(f"{path}.") for name in names if name in known]
    if follow:
        return list(dict.fromkeys(follow))
    definition, _, rest = path.partition(".")
    joints = [use.joint for use in experiment.structure.servos if use.definition == definition]
    paths = [name for joint in joints for name in (f"{joint}.servo.{rest}",) if name in known]
    if not rest:
        paths = [name for name in known for joint in joints if name.startswith(f"{joint}.servo.")]
    if paths:
        return paths
    if path in recordable(experiment.structure, [path]):
        raise Problem(
            error(
                "D170",
                f"no parameter `{path}` in `{experiment.name}`",
                help=f"it is a channel, which only a run computes: `record = [{path}];` keeps it",
            )
        )
    driven = {use.joint for use in experiment.structure.servos}
    if (
        rest.partition(".")[0] == "servo"
        and definition in {moving.name for moving in experiment.structure.moving} - driven
    ):
        raise Problem(
            error(
                "D170",
                f"no parameter `{path}` in `{experiment.name}`",
                help=f"joint `{definition}` has no servo here: it is free",
            )
        )
    if is_code(path):
        raise Problem(
            error(
                "D170",
                f"no parameter `{path}` in `{experiment.name}`",
                help=f"`met doc {path}` says what this message means",
            )
        )
    joint, _, own = rest.partition(".")
    as_run = (
        ".".join(filter(None, (joint, "servo", own))) if definition == "servos" else ""
    )  # as the run's block has it
    beyond = [name for name in known if not path.startswith(f"{name}.")]  # what it is of is no other name for it
    near = [as_run] if as_run in known else _three_nearest(path, beyond)
    helps = [f"did you mean `{'`, `'.join(near)}`?"] if near else []
    last = path.rpartition(".")[2]
    same = [name for name in known if name.rpartition(".")[2] == last and name not in near]
    if same:
        more = f" and {len(same) - MOST_NEAR} more" if len(same) > MOST_NEAR else ""
        helps.append(f"parameters called `{last}`: {', '.join(same[:MOST_NEAR])}{more}")
    head = path.rpartition(".")[0]
    beside = [name for name in known if head and name.startswith(f"{head}.")]
    if beside:
        helps.append(known_words(f"`{head}` has", [name.removeprefix(f"{head}.") for name in beside]))
    if not helps:
        helps.append(f"paths begin with {', '.join(heads)}")
    raise Problem(error("D170", f"no parameter `{path}` in `{experiment.name}`", help=helps))


def _is_run(path: str, also: Mapping[str, Sequence[str]]) -> bool:
    """Return True if a run has this name, as in `nominal.initial.shoulder.q`, which is `initial.shoulder.q`.

    An arm, too, stands before whole paths, but among them are its links; a servo's `gearbox.kp` is `elbow.servo.kp`.
    """
    reached = {head.removeprefix(f"{path}."): names for head, names in also.items() if head.startswith(f"{path}.")}
    whole = any(rest in names for rest, names in reached.items())
    return whole and not any(rest.startswith("links.") for rest in reached)


def _three_nearest(path: str, known: Iterable[str]) -> list[str]:
    """The three known paths that are most like this one."""
    near: list[str] = []
    while len(near) < 3 and (near_path := nearest(path, [name for name in known if name not in near])) is not None:
        near.append(near_path)
    return near


Names = Callable[[str], tuple[Label, ...]]


def print_explain(
    experiment: Experiment,
    path: str,
    sources: Mapping[str, str],
    names_of: Names,
    also: Mapping[str, Sequence[str]] = NO_MORE,
) -> Iterator[str]:
    """Line by line, parameter by parameter.

    sources    text of each file by name
    names_of   of a parameter, the names that its value is written with, each with what it stands for
    also       further paths with the parameters that they mean
    """
    names = find_paths(experiment, path, also)
    if len(names) > MOST_IN_FULL:
        yield from columns([_in_short(experiment, name) for name in names], indent="")
        return
    if _is_vector(experiment, names):
        used = dict.fromkeys(label for name in names for label in names_of(name))
        yield from _parameter_lines(experiment, names, sources, tuple(used))
        return
    for position, name in enumerate(names):
        if position:
            yield ""
        yield from _parameter_lines(experiment, [name], sources, names_of(name))


def explain_json(
    experiment: Experiment, path: str, also: Mapping[str, Sequence[str]] = NO_MORE
) -> list[dict[str, Any]]:
    """The explanations for programs, values in SI."""
    records = []
    for name in find_paths(experiment, path, also):
        parameter = experiment.parameters[name]
        varied = isinstance(parameter.value, Formula)
        records.append(
            {
                "path": name,
                "value": experiment.column(parameter.value).tolist()
                if isinstance(parameter.value, Formula)
                else parameter.value,
                "varies": varied,
                "unit": parameter.unit,
                "origin": parameter.origin.kind,
                "note": parameter.origin.note,
                "place": _place_json(parameter.origin.place),
                "overrides": [_place_json(place) for place in parameter.origin.overrides],
            }
        )
    return records


def _in_short(experiment: Experiment, name: str) -> tuple[str, ...]:
    """A parameter in a row: name, value, origin and place."""
    parameter = experiment.parameters[name]
    place = parameter.origin.place
    remark = _note(parameter.origin) or ORIGIN_WORDS[parameter.origin.kind].removesuffix(" here").rstrip(",")
    if place is None and parameter.origin.kind == "deck":
        remark = IN_PLAN
    return name, f"= {_value_words(experiment, parameter)}", remark, "" if place is None else str(shown_place(place))


def _note(origin: Origin) -> str:
    """A note on a value's origin; for a varied value, it is about the entry that the sweep overrides."""
    return "" if origin.kind == "case" else origin.note


def _is_vector(experiment: Experiment, names: list[str]) -> bool:
    """Return True if these are the three parts of a vector that was written as one."""
    quantities = [experiment.parameters[name] for name in names]
    together = [name.rpartition(".")[2] for name in names] == ["x", "y", "z"]
    return together and all(isinstance(q.value, float) and q.origin == quantities[0].origin for q in quantities)


def _parameter_lines(
    experiment: Experiment, names: list[str], sources: Mapping[str, str], used: tuple[Label, ...]
) -> Iterator[str]:
    """A parameter, or the three of a vector."""
    name = names[0]
    first = experiment.parameters[name]
    origin = first.origin
    if len(names) > 1:
        parts = [experiment.parameters[part].value for part in names]
        numbers = [part for part in parts if isinstance(part, float)]
        yield f"{name.rpartition('.')[0]} = {vector(numbers, first.unit, computed=origin.kind == 'derived')}"
    else:
        yield f"{name} = {_value_words(experiment, first)}"
    parameter, owner = _declaration(experiment, name)
    if parameter is not None:
        yield f"  {parameter.doc} ({owner})"
    for coordinate in _varied_by(experiment, name):
        unit = after_number(coordinate.unit)
        yield f"  varied by {coordinate.path}: {_series_of(coordinate)}{unit}"
    note = _note(origin)
    remark = note if note in (ON_COMMAND_LINE, *NOTES) else ORIGIN_WORDS[origin.kind] + (f": {note}" if note else "")
    if origin.place is None and origin.kind == "deck":
        remark = IN_PLAN
    if origin.place is None:
        yield f"  {remark}"
        return
    also = (*used, *(Label(place, f"overrides {_written_at(place, sources)}") for place in origin.overrides))
    yield from _with_source(origin.place, remark, also, sources)


def _written_at(place: Place, sources: Mapping[str, str]) -> str:
    """The entry, or the value, that begins at a place: up to its semicolon, or the end of its line.

    It ends at a bracket or comma around it, as in `classic(a = l2, d = 0 m)`; in a URDF file, the place itself.
    """
    lines = sources.get(place.file, "").split("\n")
    rest = lines[place.line - 1][place.column - 1 :] if place.line <= len(lines) else ""
    more = 0 if lines[0].startswith("<") else _end(rest[place.length :])
    text = rest[: place.length + more]
    text = " ".join(text.split())
    return f"`{text}`" if text else "this"


def _end(rest: str) -> int:
    """The end of an expression in a line: before a semicolon, a comment, or the bracket or comma around it."""
    depth = 0
    for index, character in enumerate(rest):
        if character in "([":
            depth += 1
        elif character in ")]":
            depth -= 1
        if depth < 0 or character in ";}" or (character == "," and depth == 0) or rest.startswith("//", index):
            return index
    return len(rest)


def _with_source(place: Place, remark: str, also: tuple[Label, ...], sources: Mapping[str, str]) -> Iterator[str]:
    """The place with its line, macros and includes, in the form of a diagnostic without head and count."""
    text = render.render([Diagnostic("", "", Label(place, remark), also, severity="note")], sources)
    yield from text.splitlines()[1:-2]


def _value_words(experiment: Experiment, parameter: Quantity) -> str:
    """A parameter's value in words with its unit; of a table its range, and of one that varies its range over the
    cases. What is written in a deck is shown with all its digits."""
    computed = parameter.origin.kind == "derived"
    match parameter.value:
        case str():
            return parameter.value
        case tuple() if len(parameter.value) > MOST_LISTED:
            unit = after_number(parameter.unit)
            return f"{_series(np.array(parameter.value), parameter.unit)}{unit}"
        case tuple():
            return vector(parameter.value, parameter.unit, computed=computed)
        case Formula():
            low, high = span(experiment.column(parameter.value))
            if computed:
                return f"{number(low)} to {quantity(high, parameter.unit)}, varies with the case"
            return f"{decimals([low], parameter.unit)[0]} to {written(high, parameter.unit)}, varies with the case"
        case float() | int():
            return quantity(parameter.value, parameter.unit) if computed else _written(parameter.value, parameter.unit)
    raise AssertionError(parameter)


def _written(value: float, unit: str) -> str:
    """A value of a deck, which someone may write again; in 15 digits where arithmetic left more, as in `70 g + 3 g`,
    which is 0.07300000000000001 kg."""
    text = written(value, unit)
    number, blank, unit_text = text.partition(" ")
    digits = re.sub(r"e.*|\D", "", number).strip("0")
    return text if len(digits) <= 15 else f"{float(number):.15g}{blank}{unit_text}"


def _varied_by(experiment: Experiment, name: str) -> list[Coordinate]:
    return [coordinate for coordinate in experiment.cases.coordinates if name in coordinate.sets]


def _series_of(coordinate: Coordinate) -> str:
    """A coordinate's values in the deck's unit; for a long table its ends."""
    values = coordinate.values
    if isinstance(values, np.ndarray):
        return _series(values, coordinate.unit)
    low, high = decimals(span(values), coordinate.unit)
    return f"{low} to {high}, {len(values):,} cases"


def _series(values: np.ndarray, unit: str) -> str:
    """SI values as numbers of a unit; of many, the first and the last."""
    distinct = list(dict.fromkeys(values.tolist()))
    numbers = decimals(distinct if len(distinct) <= 8 else [*distinct[:2], distinct[-1]], unit)
    return (
        ", ".join(numbers)
        if len(distinct) <= 8
        else f"{numbers[0]}, {numbers[1]} ... {numbers[2]} ({len(distinct)} values)"
    )


def _declaration(experiment: Experiment, name: str) -> tuple[Parameter | None, str]:
    """The model's declaration of a parameter, and the model's name; None and "" where no model declares it."""
    around = [use for use in model_uses(experiment.structure) if name.startswith(f"{use.head}.")]
    if not around:
        return None, ""
    use = around[-1]
    first, *rest = name.removeprefix(f"{use.head}.").split(".")
    if use.kind == "bed" and first == "scale":
        return next((parameter for parameter in bed_scale.PARAMETERS if parameter.name == rest[0]), None), "scale"
    of_joint = use.kind == "guide" and any(joint.name == first for joint in experiment.structure.joints)
    return declared(use.declaration, rest[0] if of_joint and rest else first), use.model


def _place_json(place: Place | None) -> dict[str, Any] | None:
    """A place for JSON, with the macro expansions and the turns of loops that it came through; None where there is
    none."""
    if place is None:
        return None
    steps = [{"macro": step.macro, "use": _place_json(step.use)} for step in place.macros]
    record = {
        "file": place.file,
        "line": place.line,
        "column": place.column,
        "length": place.length,
        "expansions": steps,
    }
    if place.iterations:
        record["iterations"] = [
            {"index": step.macro, "value": step.iteration, "loop": _place_json(step.use)} for step in place.iterations
        ]
    return record


# Of a deck or a plan

Source = tuple[Plan, Compiled | None]
"""A plan, and the deck from which it was compiled; None for a plan file."""

Sources = Sequence[Callable[[], Source]]
"""Plans in which to look for a path, in order; each is made only where those before lack the path."""


@frozen
class ExplainedExperiment:
    """An experiment that has the path, with its settings. alone: True if all of the first source's experiments have
    it."""

    experiment: Experiment
    plan: Plan
    compiled: Compiled | None
    number: int
    alone: bool

    @property
    def known(self) -> Mapping[str, Sequence[str]]:
        return NO_MORE if self.compiled is None else self.compiled.scopes[self.number].known

    def names_of(self, path: str) -> tuple[Label, ...]:
        if self.compiled is None:
            return ()
        return next((explained.names for explained in explanations_of(self.compiled, path)), ())


def print_explained(sources: Sources, path: str) -> Iterator[str]:
    """The explanation line by line; once where all experiments agree. Raises Problem where none has the path."""
    by_lines: dict[tuple[str, ...], list[ExplainedExperiment]] = {}
    for explained in _explained(sources, path):
        texts = {source.name: source.text for source in explained.plan.sources}
        lines = tuple(print_explain(explained.experiment, path, texts, explained.names_of, explained.known))
        by_lines.setdefault(lines, []).append(explained)
    for position, (lines, where) in enumerate(by_lines.items()):
        if position:
            yield ""
        if len(by_lines) > 1 or not where[0].alone:
            yield f"in {', '.join(explained.experiment.name for explained in where)}:"
        yield from lines


def explained_json(sources: Sources, path: str) -> list[dict[str, Any]]:
    """The explanations for programs; with several experiments each names its own."""
    all_explained = _explained(sources, path)
    several = len(all_explained) > 1 or not all_explained[0].alone
    return [
        {"experiment": explained.experiment.name, **record} if several else record
        for explained in all_explained
        for record in explain_json(explained.experiment, path, explained.known)
    ]


def _explained(sources: Sources, path: str) -> list[ExplainedExperiment]:
    """The experiments that have the path, of the first source that has it at all. sources: the run or sweep that is
    asked for first, then others of the deck. Raises the Problem of the first where none has it."""
    problem: Problem | None = None
    for n, source in enumerate(sources):
        try:
            plan, compiled = source()
        except Problem:
            if problem is not None:  # another run has other mistakes
                raise problem from None
            raise
        all_explained = []
        for index, experiment in enumerate(plan.experiments):
            whole = with_settings(experiment if compiled is None else with_all_settings(compiled, index))
            explained = ExplainedExperiment(whole, plan, compiled, index, True)
            try:
                find_paths(whole, path, explained.known)
            except Problem as unknown:
                problem = problem or _of_unit(path, compiled) or unknown
            else:
                all_explained.append(explained)
        if all_explained:
            alone = n == 0 and len(all_explained) == len(plan.experiments)
            return [replace(explained, alone=alone) for explained in all_explained]
    assert problem is not None  # each source has an experiment, and none had the path
    raise problem


def _of_unit(path: str, compiled: Compiled | None) -> Problem | None:
    """The error that a path is a unit, the deck's or the language's; None where it is not."""
    declared = compiled.units.get(path) if compiled is not None else None
    known = units.ALL_UNITS.get(path)
    if declared is not None:
        what, help = "a unit that the deck declares", f"1 {path} is {units.size_in_si(declared)}"
    elif known is not None:
        what, help = "a unit", f"{known.word}, {units.size_in_si(known.measure)}: `met doc units`"
    else:
        return None
    return Problem(error("D170", f"`{path}` is {what}, and no parameter", help=help))
