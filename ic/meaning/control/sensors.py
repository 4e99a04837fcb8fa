"""Sensors of servos: `sensor QUANTITY = MODEL { ... }` in a servo's definition or use."""

from __future__ import annotations

from dataclasses import replace

from ic.language.unit_words import unit_here
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters.models import find_model, refuse_values, use_model, word_of, words_chosen
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.diagnostic import did_you_mean, leave_out
from met.plan import SensorUse, ServoUse
from met.plan.uses import quantities

USAGE = "write `sensor QUANTITY = MODEL { ... }`"


def without_sensors(block: MergedBlock) -> MergedBlock:
    """A servo's block with its plain entries only."""
    return replace(block, items={key: item for key, item in block.items.items() if item.kind != "sensor"})


def use_sensor(scope: Scope, servo: Owner, use: ServoUse, item: Item) -> SensorUse | None:
    """One sensor of a servo in use, its parameters entered in the scope; None where it failed (already reported).

    servo  owner of the servo's parameters;  use: what there is of it
    """
    if item.detail:
        scope.complaints.error(
            "D245", f"`{item.detail[0].text}` after the name of a sensor's quantity", item.detail[0].place, help=USAGE
        )
        return None
    if models.find("servo", use.model).control is None:
        scope.complaints.error(
            "D246",
            f"{servo.label} ({use.model}) has no law that would see through a sensor",
            item.place,
            help=leave_out("leave the sensor out"),
        )
        return None
    known = quantities(use)
    if item.name not in known:
        scope.complaints.error(
            "D245",
            f"{servo.label} has no `{item.name}` to be sensed",
            item.place,
            help=[*did_you_mean(item.name, known), known_words("a sensor may be of", known)],
        )
        return None
    sensor = find_model(scope, "sensor", word_of(item.value), item.value_place)
    if sensor is None or refuse_values(scope, item.value, [p.name for p in sensor.parameters]):
        return None
    if sensor.measures is not None:
        scope.complaints.error(
            "D281",
            f"`{sensor.name}` is a sensor of a link, and this is a servo",
            item.value_place,
            help=f"write `sensor NAME = {sensor.name} {{ link = LINK; ... }}` in a run",
        )
        return None
    unit = unit_here(known[item.name], servo.joint, None, None)[0]
    path = f"sensor.{item.name}"
    owner = replace(
        servo,
        label=f"sensor `{item.name}` of {servo.label}",
        place=item.place,
        of=unit,
        path=f"{servo.path}.{path}",
        local=path,
        homes=item.homes,
    )
    body = item.body or MergedBlock()
    use_model(scope, owner, sensor.parameters, body)
    scope.keep_setting(f"{owner.path}.model", sensor.name, item=item)
    words = [parameter for parameter in sensor.parameters if parameter.shape == "word"]
    return SensorUse(item.name, sensor.name, words_chosen(words, body), item.place)
