"""Models, as declared: their kinds, one kind's models, one model with all of its numbers."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import fields
from typing import Any, get_args

from ic.language import BLOCKS
from ic.printing.glossary import entries
from ic.printing.wrapping import described, paragraphs, terminal_width
from met import models
from met.diagnostic import Problem, did_you_mean, error
from met.parameter import Parameter
from met.plan.channel import watched_unit
from met.units import ONE

KINDS: tuple[models.Kind, ...] = get_args(models.Kind)
WHERE_WRITTEN = {
    "servo": "servo NAME { model = MODEL; ... }",
    "sensor": "sensor QUANTITY = MODEL { ... }, in a servo, for `q`, `qd` or a state of it; on a link: "
    "`sensor NAME = MODEL { link = LINK; ... }`, in a run",
    "command": "command = rate(MODEL(...)), in a servo; also `position(...)`, `torque(...)` and `acceleration(...)`",
    "environment": "environment { NAME = MODEL { ... } }, in a run",
    "guide": "guide NAME = MODEL { ... }, in a run; its servos have `command = rate(NAME)` or `position(NAME)`",
    "metric": "metric NAME = MODEL { of = CHANNEL; ... }, in a run",
    "integrator": "integrator = MODEL, in a run",
    "bed": "substitute JOINT { bed = MODEL(...); ... }, in a run",
    "law": "substitute JOINT { law = MODEL(...); ... }, in a run",
}

IN_SERVO = "sensor QUANTITY = MODEL { ... }, in a servo, for `q`, `qd` or a state of the servo"
ON_LINK = "sensor NAME = MODEL { link = LINK; ... }, in a run"

OF_LANGUAGE = tuple(name for name in BLOCKS if name not in KINDS)
"""Blocks of the deck language that have no models."""

OTHERS = (*OF_LANGUAGE, "channels", "designs", "dh", "distributions", "functions", "language", "shapes", "units")
"""Further subjects of `met doc` (ic/printing/subjects.py)."""

FIELDS = tuple(field.name for field in fields(Parameter))
"""The fields of a parameter that `met doc --format json` gives."""

MEANING_OF_OF = {
    "metric": "the unit of the signal that the metric evaluates",
    "sensor": "the unit of the quantity that is sensed",
}
"""The meaning of the word `of` in units, by kind of model."""

UNIT_WORDS = {
    "joint": "rad, or m on a prismatic joint",
    "effort": "N*m, or N on a prismatic joint",
    "of": "the unit of the signal that is evaluated, or of the quantity that is sensed",
    "command": "the unit of the commanded quantity",
}


def selected_models(words: tuple[str, ...]) -> list[tuple[models.Kind, Any]]:
    """The models of a request to `met doc`: all, those of a kind, one of a kind, or all of one name. Raises D171."""
    everything = [(kind, model) for kind in KINDS for model in models.available(kind).values()]
    if not words:
        return everything
    kind = next((kind for kind in KINDS if words[0] in (kind, f"{kind}s")), None)
    if kind is not None and len(words) > 1:
        return [(kind, models.find(kind, words[1]))]
    if kind is not None:
        return [(kind, model) for k, model in everything if k == kind]
    found = [(k, model) for k, model in everything if model.name == words[0]]
    if found and len(words) == 1:
        return found
    if len(words) > 1 and (words[0] in OTHERS or found):
        whole = f"{found[0][0]} {words[0]}" if found else words[0]
        raise Problem(error("D171", f"`{words[0]}` takes no second word", help=f"`met doc {whole}` says it all"))
    known = [*KINDS, *OTHERS, *(model.name for _, model in everything), *entries()]
    helps = [*did_you_mean(words[0], known), f"kinds: {', '.join(KINDS)}; also: {', '.join(OTHERS)}"]
    raise Problem(error("D171", f"no kind of model and no model `{words[0]}`", help=helps))


def print_list(found: list[tuple[models.Kind, Any]]) -> Iterator[str]:
    """One line a model, kind by kind."""
    for kind in KINDS:
        listed = [(model.name, summary(model)) for k, model in found if k == kind]
        if listed:
            yield f"{kind}: {WHERE_WRITTEN[kind]}"
            yield from described(listed, width=terminal_width())
            yield ""
    yield "`met doc MODEL` shows everything that a model declares, `met doc channels` everything that can be recorded."
    yield f"Blocks of a deck: {', '.join(OF_LANGUAGE)}."
    others = [each for each in OTHERS if each not in OF_LANGUAGE and each != "channels"]
    yield f"Also: {', '.join(others)}; and the code of a message, as in `met doc D060`."


def print_model(kind: models.Kind, model: Any) -> Iterator[str]:
    """The whole declaration of a model."""
    yield f"{kind} {model.name}"
    width = terminal_width()
    doc = paragraphs(textwrap.dedent(model.doc).strip(), width=None if width is None else width - 2)
    yield from (f"  {line}".rstrip() for line in doc)
    yield ""
    yield f"In a deck: {where_written(kind, model)}"
    yield from declared_facts(kind, model)
    parameters = models.written(model)
    if parameters:
        yield ""
        yield "Parameters"
        yield from described(rows(parameters), width=width, head=True)
    yield from (f"  {line}" for line in sources(parameters))
    yield from (f"  {word}: {text}" for word, text in words_in(kind, parameters))
    for text, parts in recorded_channels(kind, model):
        yield ""
        yield text
        yield from described(parts, width=width)


def model_json(kind: models.Kind, model: Any) -> dict[str, Any]:
    """The whole declaration of a model, for programs."""
    record: dict[str, Any] = {"kind": kind, "name": model.name, "doc": textwrap.dedent(model.doc).strip()}
    record["parameters"] = [{field: getattr(p, field) for field in FIELDS} for p in models.written(model)]
    for words in ("commands", "unit", "order", "real_limit"):
        if hasattr(model, words) and (kind != "sensor" or getattr(model, words)):
            record[words] = getattr(model, words)
    for words in models.HELD:
        record[words] = [{"name": p.name, "unit": p.unit, "doc": p.doc} for p in getattr(model, words, ())]
    return record


def rows(parameters: Iterable[Parameter]) -> list[tuple[str, str, str, str, str]]:
    """A table of parameters with its head first."""
    rows = [(p.name, unit_in_words(p.unit), default(p), range_(p), meaning(p)) for p in parameters]
    return [("name", "unit", "default", "range", "meaning"), *rows]


def where_written(kind: models.Kind, model: Any) -> str:
    """The place of this model in a deck, in words."""
    usage = WHERE_WRITTEN[kind]
    if kind == "sensor":
        usage = IN_SERVO if model.measures is None else ON_LINK
    if kind == "metric" and model.condition:
        usage = usage.replace("CHANNEL", "CONDITION")
    return usage.replace("MODEL", model.name)


def recorded_channels(kind: models.Kind, model: Any) -> Iterator[tuple[str, list[tuple[str, str, str]]]]:
    """Channels of a servo, guide, sensor of a link, bed or law: in words, then name, unit and meaning of each."""
    for words, text in (
        ("outputs", "Outputs of the control law, updated at each tick of the servo"),
        ("integrals", "Integrals of the control law"),
        ("states", "States of the servo, integrated with the motion of the arm"),
        ("signals", "Signals computed at every instant"),
    ):
        parts = getattr(model, words, ())
        if parts and kind == "servo":
            yield f"{text}; recorded as JOINT.servo.NAME", [(p.name, unit_in_words(p.unit), p.doc) for p in parts]
    if kind == "guide" and model.memory:
        rows = [(p.name, unit_in_words(p.unit), p.doc) for p in model.memory]
        yield "Outputs of the guide, updated at each of its ticks; recorded as guides.NAME.NAME", rows
    if kind == "sensor" and model.measures is not None:
        rows = [(p.name, unit_in_words(watched_unit(p.unit, model.unit)), p.doc) for p in model.states]
        yield "States of the sensor, recorded as sensors.NAME.NAME; its reading is recorded as sensors.NAME", rows
    shown = list(model.shown if kind in ("bed", "law") else ())
    if shown:
        rows = [(name, unit_in_words(unit), doc) for name, unit, doc in shown]
        yield f"Values of the {kind}, updated at each tick of the servo; recorded as JOINT.{kind}.NAME", rows


def declared_facts(kind: models.Kind, model: Any) -> Iterator[str]:
    """Further facts that a model declares, in a line each."""
    for words, text in (
        ("commands", "Kinds of command"),
        ("order", "Order"),
        ("real_limit", "Stable as long as the step times the rate of a decay (1/s) is below"),
    ):
        value = getattr(model, words, None)
        if value:
            text = "Kinds of command that it gives" if kind == "guide" else text
            yield f"{text}: {', '.join(value) if isinstance(value, tuple) else ONE.decimal(value)}"
    if kind == "sensor" and model.unit:
        yield f"Unit of the reading: {model.unit}"
    if kind == "metric":
        meant = UNIT_WORDS | {"of": MEANING_OF_OF["metric"]}
        yield f"Unit of the result: {meant.get(model.unit, unit_in_words(model.unit))}"


def words_in(kind: models.Kind, parameters: tuple[Parameter, ...]) -> Iterator[tuple[str, str]]:
    """The unit words that depend on the use, with their meanings."""
    used = {word for p in parameters for word in UNIT_WORDS if word in re.split(r"\W+", p.unit)}
    meanings = {**UNIT_WORDS, "of": MEANING_OF_OF.get(kind, UNIT_WORDS["of"])}
    return ((word, text) for word, text in meanings.items() if word in used)


def summary(model: Any) -> str:
    """The first sentence of a model's description."""
    first = " ".join(model.doc.strip().split("\n\n")[0].split())
    return re.split(r"(?<!\beq)\. ", first)[0].rstrip(".:")


def unit_in_words(unit: str) -> str:
    """A declared unit; a dash for a pure number."""
    return "-" if unit == "1" else unit


def default(parameter: Parameter) -> str:
    """The default; `needed` where the deck must write the parameter."""
    value = parameter.default
    if parameter.of_servo:
        return "the servo's" if parameter.of_servo == parameter.name else f"the servo's {parameter.of_servo}"
    if value is None:
        return "needed"
    if isinstance(value, str):
        return value
    if value == ():
        return "none"
    needed = f"; needed under {', '.join(parameter.needed_for)}" if parameter.needed_for else ""
    return f"[{', '.join(map(ONE.decimal, value))}]" if isinstance(value, tuple) else f"{ONE.decimal(value)}{needed}"


def range_(parameter: Parameter) -> str:
    """The bounds in SI, or the allowed words."""
    if parameter.names:
        return " | ".join((f"a {parameter.names}", *parameter.words))
    if parameter.words:
        return " | ".join(parameter.words)
    whole = ["whole"] if parameter.whole else []
    bounds = (("> ", parameter.above), (">= ", parameter.at_least), ("< ", parameter.below), ("<= ", parameter.at_most))
    bounded = ", ".join(whole + [f"{sign}{ONE.decimal(bound)}" for sign, bound in bounds if bound is not None])
    needed = parameter.above_where_needed
    return bounded if needed is None else f"{bounded}; > {ONE.decimal(needed)} where needed".removeprefix("; ")


def meaning(parameter: Parameter) -> str:
    """A parameter's description, with its shape and the word on which it depends."""
    only = "" if parameter.only is None else f"; only with {parameter.only[0]} = {' or '.join(parameter.only[1])}"
    shape = {"vector": "three numbers; ", "list": "a list; ", "text": "a text in quotes; "}.get(parameter.shape, "")
    shape = "the same in all cases; " if parameter.decides else shape
    return f"{shape}{parameter.doc}{only}"


def sources(parameters: Iterable[Parameter]) -> list[str]:
    """The sources of parameters, a line for each: `Source of kp, ki: ...`."""
    named: dict[str, list[str]] = {}
    for each in parameters:
        if each.source and each.name not in named.setdefault(each.source, []):
            named[each.source].append(each.name)
    return [f"Source of {', '.join(names)}: {source}" for source, names in named.items()]
