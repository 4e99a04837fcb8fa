"""Pages of `met doc` about models: all that a model declares, with its parameters and channels in words."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any

from ic.printing.page import Page, Table
from met import models
from met.parameter import Parameter
from met.plan.channel import watched_unit
from met.units import ONE

KINDS = tuple(models.GROUPS)
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


def model_page(kind: models.Kind, model: Any) -> Page:
    """The whole declaration of a model."""
    return Page(
        subject=model.name,
        title=f"{kind} {model.name}",
        prose=model.doc,
        usage=where_written(kind, model),
        facts=list(declared_facts(kind, model)),
        parts=(
            parameter_table(models.written(model), caption="Parameters", kind=kind),
            *recorded_channels(kind, model),
        ),
        records=[model_record(kind, model)],
    )


def model_record(kind: models.Kind, model: Any) -> dict[str, Any]:
    """The whole declaration of a model, for programs."""
    record: dict[str, Any] = {"kind": kind, "name": model.name, "doc": textwrap.dedent(model.doc).strip()}
    record["parameters"] = [parameter_record(parameter) for parameter in models.written(model)]
    for words in ("commands", "unit", "order", "real_limit"):
        if hasattr(model, words) and (kind != "sensor" or getattr(model, words)):
            record[words] = getattr(model, words)
    for words in models.HELD:
        record[words] = [{"name": p.name, "unit": p.unit, "doc": p.doc} for p in getattr(model, words, ())]
    return record


def parameter_record(parameter: Parameter) -> dict[str, Any]:
    """A parameter with its whole declaration, for programs; bounds are in SI."""
    return {field.name: getattr(parameter, field.name) for field in fields(Parameter)}


def parameter_table(parameters: Sequence[Parameter], *, caption: str, kind: str = "") -> Table:
    """The table of parameters, of a kind of model if it is one, with their sources."""
    meanings = {**UNIT_WORDS, "of": MEANING_OF_OF.get(kind, UNIT_WORDS["of"])}
    return Table(
        head=("name", "unit", "default", "range", "meaning"),
        rows=[(p.name, unit_in_words(p.unit), default(p), range_(p), meaning(p)) for p in parameters],
        caption=caption,
        notes=sources(parameters),
        words=words_in([p.unit for p in parameters], meanings),
    )


def where_written(kind: models.Kind, model: Any) -> str:
    """The place of this model in a deck, in words."""
    usage = WHERE_WRITTEN[kind]
    if kind == "sensor":
        usage = IN_SERVO if model.measures is None else ON_LINK
    if kind == "metric" and model.condition:
        usage = usage.replace("CHANNEL", "CONDITION")
    return usage.replace("MODEL", model.name)


SERVO_CHANNELS = {
    "outputs": "Outputs of the control law, updated at each tick of the servo; recorded as JOINT.servo.NAME",
    "integrals": "Integrals of the control law; recorded as JOINT.servo.NAME",
    "states": "States of the servo, integrated with the motion of the arm; recorded as JOINT.servo.NAME",
    "signals": "Signals computed at every instant; recorded as JOINT.servo.NAME",
}
"""The fields of a servo's declaration that list channels, with what they are."""


def recorded_channels(kind: models.Kind, model: Any) -> Iterator[Table]:
    """Tables of the channels of a servo, guide, sensor of a link, environment model, bed or law."""
    if kind == "servo":
        for field, caption in SERVO_CHANNELS.items():
            yield _channel_table(caption, [(p.name, p.unit, p.doc) for p in getattr(model, field)])
    if kind == "guide":
        caption = "Outputs of the guide, updated at each of its ticks; recorded as guides.NAME.NAME"
        yield _channel_table(caption, [(p.name, p.unit, p.doc) for p in model.memory])
    if kind == "sensor" and model.measures is not None:
        caption = "States of the sensor, recorded as sensors.NAME.NAME; its reading is recorded as sensors.NAME"
        yield _channel_table(caption, [(p.name, watched_unit(p.unit, model.unit), p.doc) for p in model.states])
    if kind == "environment":
        caption = "Signals computed at every instant; recorded as environment.NAME.NAME"
        yield _channel_table(
            caption, [(p.name, p.unit, "; ".join(filter(None, (p.doc, p.axes)))) for p in model.signals]
        )
    if kind in ("bed", "law"):
        caption = f"Values of the {kind}, updated at each tick of the servo; recorded as JOINT.{kind}.NAME"
        yield _channel_table(caption, model.shown)


def _channel_table(caption: str, channels: Iterable[tuple[str, str, str]]) -> Table:
    rows = [(name, unit_in_words(unit), doc) for name, unit, doc in channels]
    return Table(head=("name", "unit", "meaning"), rows=rows, headed=False, caption=caption)


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


def words_in(units: Iterable[str], meanings: Mapping[str, str]) -> list[tuple[str, str]]:
    """The words of these that units use, with their meanings."""
    used = {word for unit in units for word in re.split(r"\W+", unit)}
    return [(word, text) for word, text in meanings.items() if word in used]


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
    for parameter in parameters:
        if parameter.source and parameter.name not in named.setdefault(parameter.source, []):
            named[parameter.source].append(parameter.name)
    return [f"Source of {', '.join(names)}: {source}" for source, names in named.items()]
