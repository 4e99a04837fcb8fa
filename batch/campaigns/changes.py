"""Differences between two plans, in the words of their decks: for a campaign that is continued with another deck, and
for comparisons of archives."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ic.printing.columns import count
from met.diagnostic import Place
from met.frozen import frozen
from met.plan import BASE, Base, Cases, Command, Course, Experiment, Formula, Plan, Quantity, Schedule, Structure
from met.plan.columns import CaseValues, blocks, different
from met.plan.judged import LinearUse, Requirement
from met.plan.keys import in_key, inputs, structure_key
from met.plan.searches import Search
from met.trace import Formulas
from met.unit_parser import decimals

AXES = ("x", "y", "z")


@frozen
class Change:
    """A change, in words, that may affect numbers.

    follows  whether it cannot be the cause: it follows from something else that is told
    before   the place that wrote the old value, now: the new one, where a parameter differs
    """

    text: str
    follows: bool = False
    before: Place | None = None
    now: Place | None = None


def changes(before: Plan, now: Plan, *, ordered: bool = True) -> list[str]:
    """The changes that may affect numbers, one a line. ordered: another order of cases counts as a change"""
    out = []
    old, new = ({experiment.name: experiment for experiment in plan.experiments} for plan in (before, now))
    if list(old) != list(new):
        out.append(f"runs and sweeps: {', '.join(old)} -> {', '.join(new)}")
    for name in old:
        if name in new:
            head = f"{name}: " if len(new) > 1 else ""
            differences = between(old[name], new[name], ordered=ordered)
            out += [head + change.text for change in sorted(differences, key=lambda change: change.follows)]
    return out


def between(before: Experiment, now: Experiment, *, ordered: bool) -> list[Change]:
    """The differences of two experiments. ordered: True where another order of cases counts"""
    structures = [*_structures(before.structure, now.structure)]
    new = {entity for entity, _ in structures if entity}
    out = [Change(text) for _, text in structures if text]
    if before.search is None or now.search is None:
        cases = [Change(text) for text in _cases(before.cases, now.cases, ordered)]
    else:  # whose cases follow from the search
        cases = [Change(text) for text in _searches(before.search, now.search)]
        cases += [Change(text) for text in _tuned_limits(before, now)]
    cases += [Change(text) for text in _stops(before, now)]
    cases += [Change(text) for text in _linear(before, now)]
    out += [*_parameters(before, now, new), *cases]
    if before.formulas != now.formulas and not out:
        out.append(Change("what follows from the varied parameters is computed otherwise"))
    if not out and structure_key(before.structure, inputs(before)) != structure_key(now.structure, inputs(now)):
        out.append(Change("the structure"))  # no words for the difference
    return out


def _linear(before: Experiment, now: Experiment) -> Iterator[str]:
    """Changes of linear answers, and of metrics of them."""
    for word, texts_of in (("linear", _answers), ("metric", _figures)):
        for name, change in _changed_words(texts_of(before), texts_of(now)):
            yield f"{word} {name}: {change}"


def _changed_words(before: Mapping[str, str], now: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """The names that have another word now, with both words, `none` where it has none: `friction`, `none -> lugre`."""
    for name in dict.fromkeys([*before, *now]):
        words = [word_of.get(name, "none") for word_of in (before, now)]
        if words[0] != words[1]:
            yield name, " -> ".join(words)


def _changed_entries(
    before: Mapping[str, Any], now: Mapping[str, Any], *, new: str, gone: str, other: str
) -> Iterator[str]:
    """A line for each name that is new, gone, or has another value: the name, followed by what is said of these."""
    for name in dict.fromkeys([*before, *now]):
        if before.get(name) != now.get(name):
            yield name + (gone if name not in now else new if name not in before else other)


def _answers(experiment: Experiment) -> dict[str, str]:
    return {use.name: ", ".join(_answer_parts(use)) for use in experiment.linear}


def _answer_parts(use: LinearUse) -> Iterator[str]:
    yield use.where
    yield from (f"{number:.9g}" for number in use.pose or ())
    yield from (*use.inputs, *use.outputs, *(f"open {path}" for path in use.opened))


def _figures(experiment: Experiment) -> dict[str, str]:
    return {use.name: f"{use.model} of {use.of}" for use in experiment.linear_metrics}


# Parameters


def _parameters(before: Experiment, now: Experiment, new: set[str]) -> Iterator[Change]:
    """Changes of parameters. new: prefixes of the paths of things that are new, gone, or of another kind"""
    computed, booms = _Computed(before, now), dict[str, Change]()
    springs = before.structure.springs & now.structure.springs
    for path, old in sorted(before.parameters.items()):
        if path in now.parameters and _unlike(old, now.parameters[path]):
            sides = (before, old), (now, now.parameters[path])
            boom_change = _of_spring(path, *sides) if path.partition(".")[0] in springs else None
            if boom_change is None:
                yield _changed(path, old, now.parameters[path])
            else:
                booms.setdefault(boom_change.text, boom_change)
        elif path in now.parameters:
            yield from computed.change(path)
    yield from booms.values()
    for word, mine, other in (("new", now, before), ("gone", before, now)):
        for name, members in _vectors(sorted(mine.parameters.keys() - other.parameters.keys())).items():
            first, *_ = quantities = [mine.parameters[member] for member in members]
            follows = first.origin.kind == "derived" or any(name.startswith(entity) for entity in new)
            places = (None, first.origin.place) if mine is now else (first.origin.place, None)
            yield Change(f"{name} is {word}: {_shown_all(quantities)}{_place_text(first)}", follows, *places)


def _of_spring(path: str, *sides: tuple[Experiment, Quantity]) -> Change | None:
    """The change of a number of a boom's spring as that of the boom; None where it is none of the boom's, or varied."""
    joint, _, name = path.partition(".servo.")
    boom, values = joint.rpartition("_")[0], [quantity.value for _, quantity in sides]
    if name == "damping":
        return _changed(f"damping of the springs of boom {boom}", *(quantity for _, quantity in sides))
    way = [[experiment.parameters[f"links.{boom}.com.{axis}"].value for axis in AXES] for experiment, _ in sides]
    if name != "stiffness" or not all(isinstance(number, float) for number in (*values, *way[0], *way[1])):
        return None
    # at each of `alike` springs an equal share of the length bends, which is twice the way to the centre of mass
    alike = sum(spring.startswith(f"{boom}_") and spring[-1] == joint[-1] for spring in sides[0][0].structure.springs)
    beams = [value * 2.0 * math.hypot(*vector) / alike for value, vector in zip(values, way, strict=True)]  # type: ignore
    if math.isclose(*beams, rel_tol=1e-12):
        return None
    changed = (replace(quantity, value=beam, unit="N*m^2") for (_, quantity), beam in zip(sides, beams, strict=True))
    return _changed(f"links.{boom}.{'GJ' if alike == 1 else 'EI'}", *changed)


def _unlike(old: Quantity, new: Quantity) -> bool:
    return _value(old) != _value(new) and not (isinstance(old.value, Formula) and isinstance(new.value, Formula))


def _changed(path: str, old: Quantity, new: Quantity) -> Change:
    """The change of a parameter that both have. One that is computed, or newly varied by a sweep, follows from other
    changes."""
    follows = new.origin.kind == "derived" or isinstance(old.value, Formula) or isinstance(new.value, Formula)
    return Change(
        f"{path}: {' -> '.join(_apart(old, new))}{_place_text(new)}", follows, old.origin.place, new.origin.place
    )


MOST_CASES = 10_000
"""Number of cases, spread over the table, in which parameters that vary with the case are compared."""


class _Computed:
    """Parameters that vary with the case in both, computed for the same cases by each plan's formulas."""

    def __init__(self, before: Experiment, now: Experiment) -> None:
        self.before, self.now = before, now
        self.values: tuple[list[Any], list[Any]] = ([], [])
        if before.formulas != now.formulas:
            cases = _some_cases(before.cases, now.cases)
            self.values = before.formulas.replay(cases), now.formulas.replay(cases)

    def change(self, path: str) -> Iterator[Change]:
        """The change of a parameter that follows from others; none where its values are the same."""
        old, new = self.before.parameters[path], self.now.parameters[path]
        if not self.values[0] or not isinstance(old.value, Formula) or not isinstance(new.value, Formula):
            return
        pair = ((self.values[0], old.value), (self.values[1], new.value))
        first, two = (np.atleast_1d(np.asarray(values[formula.output], dtype=float)) for values, formula in pair)
        if ((first == two) | (np.isnan(first) & np.isnan(two))).all():
            return
        sides = ((replace(old, unit="1"), first), (replace(new, unit="1"), two))
        ends = [
            _apart(*(replace(side, value=float(end(column))) for side, column in sides)) for end in (np.min, np.max)
        ]
        unit = "" if new.unit == "1" else f" {new.unit}"
        texts = [f"{low if low == high else f'{low} to {high}'}{unit}" for low, high in zip(*ends, strict=True)]
        text = " -> ".join(texts) if texts[0] != texts[1] else f"other values of {texts[0]}"
        follows = new.origin.kind == "derived"
        yield Change(f"{path}: {text}, varied{_place_text(new)}", follows, old.origin.place, new.origin.place)


def _some_cases(before: Cases, now: Cases) -> dict[str, np.ndarray]:
    """Values of all varied parameters in cases of `now`; those that it does not vary have their former values."""
    rows = np.unique(np.linspace(0, max(0, now.count - 1), MOST_CASES, dtype=np.int64)) if now.count else np.arange(0)
    values = {
        coordinate.path: np.resize(coordinate.values[: len(rows)], len(rows)) for coordinate in before.coordinates
    }
    return values | {coordinate.path: coordinate.values[rows] for coordinate in now.coordinates}


def _place_text(quantity: Quantity) -> str:
    place = quantity.origin.place
    return f" ({place.file}:{place.line})" if place else ""


def _vectors(paths: Iterable[str]) -> dict[str, list[str]]:
    """The paths by name; three components of a vector come under its name."""
    names: dict[str, list[str]] = {}
    known = dict.fromkeys(paths)
    for path in known:
        vector, _, axis = path.rpartition(".")
        members = [f"{vector}.{component}" for component in AXES]
        whole = axis in AXES and all(member in known for member in members)
        names[vector if whole else path] = members if whole else [path]
    return names


def _value(quantity: Quantity) -> Any:
    return "varied" if isinstance(quantity.value, Formula) else quantity.value


def _apart(before: Quantity, now: Quantity) -> tuple[str, str]:
    """The values of two parameters in the fewest digits, but at least six, that distinguish them."""
    for digits in range(6, 18):
        texts = _value_text(before, digits), _value_text(now, digits)
        if texts[0] != texts[1]:
            break
    return texts


def _value_text(quantity: Quantity, digits: int = 6) -> str:
    value = _value(quantity)
    number_text_ = f"{value:.{digits}g}" if isinstance(value, float) else str(value)
    return f"{number_text_} {quantity.unit}" if isinstance(value, float) and quantity.unit != "1" else number_text_


def _shown_all(quantities: Sequence[Quantity]) -> str:
    """Values of a vector in words, with its unit."""
    if len(quantities) == 1:
        return _value_text(quantities[0])
    unit = quantities[0].unit
    numbers = ", ".join(_value_text(dataclasses.replace(quantity, unit="1")) for quantity in quantities)
    return f"[{numbers}]" + (f" {unit}" if unit != "1" else "")


# Cases


def _cases(before: Cases, now: Cases, ordered: bool) -> Iterator[str]:
    """Changes of the cases: number, varied values, seeds and repeats. ordered: whether another order of values is a
    change"""
    old, new = ({c.path: c for c in cases.coordinates} for cases in (before, now))
    if before.count != now.count:
        yield f"{count(before.count, 'case')} -> {count(now.count, 'case')}"
    for path in dict.fromkeys([*old, *new]):
        if path not in old:
            yield f"{path} is varied now: {_span(new[path])}"
        elif path not in new:
            yield f"{path} is not varied any more"
        elif not _same(old[path].values, new[path].values, ordered):
            spans = [_span(coordinates[path]) for coordinates in (old, new)]
            yield f"{path}: {' -> '.join(spans)}" if spans[0] != spans[1] else f"{path}: other values ({spans[1]})"
    for name in ("seed", "seeds"):
        if getattr(before, name) != getattr(now, name):
            yield f"{name}: {_word(getattr(before, name))} -> {_word(getattr(now, name))}"
    if not _alike(*(_array(cases.repeats) for cases in (before, now))):
        repeats = [len(different(_array(cases.repeats))) for cases in (before, now)]
        yield f"repeats: {repeats[0]} -> {repeats[1]}" if repeats[0] != repeats[1] else "repeats: in other cases"


def _stops(before: Experiment, now: Experiment) -> Iterator[str]:
    """Changes that affect how many cases of a design point are run, where results decide that."""
    early = [bool(experiment.cases.until_shown) for experiment in (before, now)]
    if early[0] != early[1]:
        yield "cases are run until it is shown what is required" if early[1] else "all cases are run"
    elif early[1]:
        old, new = (
            {
                requirement.text: _shown_by(requirement)
                for requirement in run.requirements
                if requirement.confidence is not None
            }
            for run in (before, now)
        )
        yield from _changed_entries(
            old,
            new,
            new=" is to be shown now",
            gone=" is not to be shown any more",
            other=": with another limit, share or confidence",
        )


def _searches(before: Search, now: Search) -> Iterator[str]:
    """Changes of a search's parameters, their bounds, and its number of cases."""
    if before.goal != now.goal:
        yield f"goal: {before.goal} -> {now.goal}"
    old, new = ({parameter.path: parameter for parameter in search.parameters} for search in (before, now))
    yield from _changed_entries(
        old, new, new=" is chosen now", gone=" is not chosen any more", other=" is chosen between other ends"
    )
    if before.against != now.against:
        yield f"against: {before.against or 'nothing'} -> {now.against or 'nothing'}"
    elif before.plants != now.plants:
        yield f"against: other cases of {now.against}"
    for name in ("at_most", "seed", "margin", "gradients"):
        if getattr(before, name) != getattr(now, name):
            yield f"{name}: {_word(getattr(before, name))} -> {_word(getattr(now, name))}"


def _tuned_limits(before: Experiment, now: Experiment) -> Iterator[str]:
    """Changes of the requirements of a tuning, which decide the worth of its cases, and so its later cases."""
    old, new = ([requirement.text for requirement in run.requirements] for run in (before, now))
    if old != new and now.search is not None and now.search.kind == "tune":
        gone, come = ([text for text in some if text not in other] for some, other in ((old, new), (new, old)))
        yield f"requirements: {', '.join(gone) or 'none'} -> {', '.join(come) or 'none'}"


def _shown_by(requirement: Requirement) -> tuple[object, ...]:
    """Everything that decides which cases meet a requirement, and how many of them should."""
    return requirement.metric, requirement.comparison, requirement.limit, requirement.share, requirement.confidence


def _same(before: CaseValues, now: CaseValues, ordered: bool) -> bool:
    """True if a parameter takes the same values. ordered: in the same cases of the table"""
    return _alike(before, now) if ordered else _alike(different(before), different(now))


def _alike(first: CaseValues, two: CaseValues) -> bool:
    """True if two columns have the same numbers."""
    return len(first) == len(two) and all(
        np.array_equal(first[rows], two[rows], equal_nan=True) for rows in blocks(len(first))
    )


def _span(coordinate: Any) -> str:
    """The values of a varied parameter in words, in the deck's unit."""
    values = different(coordinate.values)
    unit = f" {coordinate.unit}" if coordinate.unit not in ("", "1") else ""
    if len(values) <= 3:
        return f"[{', '.join(decimals(values, coordinate.unit))}]{unit}"
    low, high = decimals((values.min(), values.max()), coordinate.unit)
    return f"{len(values):,} values from {low} to {high}{unit}"


def _array(values: CaseValues | None) -> CaseValues:
    return np.empty(0) if values is None else values


# Structures

ENTITIES = {
    "links": ("link", ("links.{}.",)),
    "joints": ("joint", ("{}.", "initial.{}.")),
    "servos": ("servo of", ("{}.servo.",)),
    "environment": ("environment", ("environment.{}.",)),
    "metrics": ("metric", ("metrics.{}.",)),
    "record": ("record:", ()),
    "substitutions": ("bed of", ("{}.bed.", "{}.law.")),
    "payloads": ("payload", ("payloads.{}.",)),
    "guides": ("guide", ("guides.{}.",)),
    "sensors": ("sensor", ("sensors.{}.",)),
    "expressions": ("expression", ()),
}
"""The fields of a structure that hold several things: the word for one of them, and the prefixes of its parameters'
paths."""

WHOLE = {
    "joints": {"kind"},
    "servos": {"model", "command"},
    "environment": {"model"},
    "metrics": {"model"},
    "guides": {"model"},
    "sensors": {"model"},
    "substitutions": {"bed", "law", "scaled"},
}
"""Fields whose change gives a thing other parameters."""

NOT_TOLD = frozenset({"channels", "words", "schedule", "base"})
"""Fields that are not reported separately, besides those in no key: channels follow from the record, words are
parameters too, a schedule has rates, and the base is reported first."""


def _structures(before: Structure, now: Structure) -> Iterator[tuple[str, str]]:
    """Changes in words, each with the prefix of the paths of the parameters that follow from it, or ""."""
    yield from (("", text) for text in _schedule(before.schedule, now.schedule))
    yield from _base(before.base, now.base)
    for field in dataclasses.fields(Structure):
        old, new = getattr(before, field.name), getattr(now, field.name)
        if in_key(field) == "never" or field.name in NOT_TOLD or (old == new and before.schedule == now.schedule):
            continue
        if field.name in ENTITIES:
            yield from _entities(field.name, before, now)
        elif old != new:
            yield "", f"{field.name}: {_word(old)} -> {_word(new)}"


def _schedule(before: Schedule, now: Schedule) -> Iterator[str]:
    """Changes of duration and rates, in words."""
    for name, old, new in (
        ("duration", f"{before.duration:g} s", f"{now.duration:g} s"),
        ("rates.dynamics", f"{before.base_hz / before.dynamics:g} Hz", f"{now.base_hz / now.dynamics:g} Hz"),
        ("rates.record", f"{before.base_hz / before.record:g} Hz", f"{now.base_hz / now.record:g} Hz"),
    ):
        if old != new:
            yield f"{name}: {old} -> {new}"


def _base(before: Base | None, now: Base | None) -> Iterator[tuple[str, str]]:
    """Changes of the base's kind and motion, each with the prefix of paths that follow from it."""
    kinds = ["fixed" if base is None else base.kind for base in (before, now)]
    if kinds[0] != kinds[1]:
        yield f"initial.{BASE}.", f"base: {kinds[0]} -> {kinds[1]}"
        yield from ((path, "") for path in (f"{BASE}.", f"links.{BASE}."))
    elif before is not None and now is not None:
        for component, change in _courses(before.courses, now.courses):
            yield f"base.{component}.", f"base: {component} {change}"


def _courses(before: Sequence[Course], now: Sequence[Course]) -> Iterator[tuple[str, str]]:
    """The components whose motion in time is another command's model now, with both models."""
    old, new = ({course.component: course.model for course in courses} for courses in (before, now))
    return _changed_words(old, new)


def _entities(field: str, before: Structure, now: Structure) -> Iterator[tuple[str, str]]:
    """Changes of the things in one field: new and missing ones, and differences in the others."""
    what, begins = ENTITIES[field]
    old, new = ({_name(entity): entity for entity in getattr(structure, field)} for structure in (before, now))
    if list(old) != list(new) and sorted(old) == sorted(new) and field != "servos":
        yield "", f"{field}: in another order"
    for name in dict.fromkeys([*old, *new]):
        heads = [begin.format(name) for begin in begins]
        if field == "links" and name == BASE:
            continue
        if name not in old or name not in new:
            text = f"{what} {name} is {'new' if name in new else 'gone'}"
            yield from zip(heads or [""], [text, ""], strict=False)
            continue
        for key, text in _thing(field, old[name], new[name], before, now):
            line = f"{what} {name} {text}" if what.endswith(":") else f"{what} {name}: {text}"
            yield from zip(heads if key in WHOLE.get(field, ()) else [""], [line, ""], strict=False)


def _thing(field: str, old: Any, new: Any, before: Structure, now: Structure) -> Iterator[tuple[str, str]]:
    """Changes of one thing: the names of its fields, in words."""
    for field_ in dataclasses.fields(new):
        old_value, two = getattr(old, field_.name), getattr(new, field_.name)
        if field_.name == "divisor":
            rates = [_rate(divisor, structure.schedule) for divisor, structure in ((old_value, before), (two, now))]
            # a part that ticks once a step of the dynamics changes with them, which are told by themselves
            if rates[0] != rates[1] and (old_value, two) != (before.schedule.dynamics, now.schedule.dynamics):
                yield field_.name, f"rate {rates[0]} -> {rates[1]}"
        elif old_value == two or in_key(field_) == "never" or field_.name in NOT_TOLD:
            continue
        elif isinstance(old_value, Formulas):
            yield field_.name, f"{old.text} -> {new.text}" if old.text != new.text else "computed otherwise"
        elif field_.name == "courses":
            yield from (("courses", f"{component} {change}") for component, change in _courses(old_value, two))
        elif field == "servos" and field_.name == "sensors":
            old_models, models = ({sensor.of: sensor.model for sensor in sensors} for sensors in (old_value, two))
            for source, change in _changed_words(old_models, models):
                yield "sensors", f"sensor of {source} {change}"
        elif field == "record" and field_.name == "joints":
            if {joint.name for joint in before.moving} == {joint.name for joint in now.moving}:
                yield field_.name, f"of {_word(old_value)} -> of {_word(two)}"
        else:
            yield field_.name, f"{field_.name} {_word(old_value)} -> {_word(two)}"


def _rate(divisor: int | None, schedule: Schedule) -> str:
    return "at every stage" if divisor is None else f"{schedule.base_hz / divisor:g} Hz"


def _name(entity: Any) -> str:
    """The name of one of several things: for a servo its joint, for a link its own."""
    return str(getattr(entity, "joint", None) or entity.name)


def _word(value: Any) -> str:
    """A field's value in words; of a part of a plan its name, never its Python."""
    match value:
        case None:
            return "none"
        case bool():
            return "on" if value else "off"
        case str() | int() | float():
            return str(value)
        case tuple():
            return ", ".join(map(_word, value)) or "none"
        case Command():
            return f"{value.kind}({value.model or f'guide {value.guide}'})"
    return str(getattr(value, "name", "another"))
