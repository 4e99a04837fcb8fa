"""Sensors of servos, `sensor QUANTITY = MODEL { ... }`, and of links, `sensor NAME = MODEL { ... }` in a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from ic.language.unit_words import unit_here
from ic.meaning.control.schedule import Ticker, fixed_rate
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters.models import find_model, model_of_entry, refuse_values, use_model, word_of, words_chosen
from ic.meaning.parameters.owner import Owner, a_model
from ic.meaning.parameters.relations import check_names
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.diagnostic import did_you_mean, leave_out
from met.frozen import frozen
from met.plan import LinkSensor, Payload, SensorUse, ServoUse
from met.plan.uses import quantities

KIND: Final = "sensor"
USAGE_ON_LINK = "write `sensor NAME = MODEL { link = LINK; ... }`"
USAGE = "write `sensor QUANTITY = MODEL { ... }`"


def without_sensors(block: MergedBlock) -> MergedBlock:
    """A servo's block with its plain entries only."""
    return replace(block, items={key: item for key, item in block.items.items() if item.kind != KIND})


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
    sensor = find_model(scope, KIND, word_of(item.value), item.value_place)
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


# On links


@frozen
class Sensing(Ticker):
    """A sensor on a link. values: of its parameters; empty where one is wrong"""

    model: str
    words: tuple[tuple[str, str], ...]
    values: Mapping[str, Any]

    kind = KIND
    verb = "reads"
    code = "D282"

    def use(self, divisor: int) -> LinkSensor:
        """The sensor as a plan has it. divisor: base ticks between its readings"""
        return LinkSensor(self.name, self.model, divisor, self.words, self.place)


def resolve_link_sensors(
    scope: Scope, block: MergedBlock, arm: ResolvedArm, payloads: tuple[Payload, ...]
) -> list[Sensing]:
    """Every sensor of the run, in the deck's order; mistakes are reported."""
    scope.sensors = frozenset(item.name for item in block.of_kind(KIND))
    sensors = []
    for item in block.of_kind(KIND):
        with scope.complaints.gather():
            sensing = _sensor(scope, item, arm, payloads)
            if sensing is not None:
                sensors.append(sensing)
    return sensors


def _sensor(scope: Scope, item: Item, arm: ResolvedArm, payloads: tuple[Payload, ...]) -> Sensing | None:
    """The sensor of an entry; None where it has a mistake, which is reported."""
    on_links = sorted(name for name, model in models.available(KIND).items() if model.measures is not None)
    others = known_words("sensors of links", on_links)
    sensor = model_of_entry(scope, item, KIND, "D280", [USAGE_ON_LINK, others])
    if sensor is None or refuse_values(scope, item.value, [p.name for p in sensor.parameters]):
        return None
    if sensor.measures is None:
        scope.complaints.error(
            "D281",
            f"`{sensor.name}` is a sensor of a joint, and this is a run",
            item.value_place,
            help=[
                f"write `sensor QUANTITY = {sensor.name} {{ ... }}` in a servo, such as of `qd`",
                others,
            ],
        )
        return None
    body = item.body or MergedBlock()
    owner = Owner(f"sensor `{item.name}`", item.place, f"sensors.{item.name}", homes=item.homes, of=sensor.unit)
    scope.keep_setting(f"{owner.path}.model", sensor.name, item=item)
    bodies = [*(link.name for link in arm.links), *(payload.name for payload in payloads)]
    known = {"joint": [joint.name for joint in arm.moving], "link": bodies}
    check_names(scope, owner, sensor.parameters, body, arm=arm.name, known=known, failed=arm.failed)
    values = use_model(scope, owner, sensor.parameters, body, ["rate"])
    scope.not_sweepable[owner.path] = a_model("a sensor", owner.path)
    rate_item = body.get("rate")
    rate = fixed_rate(scope, owner, rate_item, owner.label, doc="how often it reads") if rate_item is not None else None
    words = [parameter for parameter in sensor.parameters if parameter.shape == "word" and not parameter.names]
    return Sensing(item.name, rate, item.place, sensor.name, words_chosen(words, body), values or {})
