"""Sensors of links: `sensor NAME = MODEL { ... }` in a run; their parameters and their ticks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from ic.grammar.syntax import place_of
from ic.meaning.control.schedule import Rate
from ic.meaning.control.servos import fixed_rate
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters.models import find_model, refuse_values, use_model, word_of, words_chosen
from ic.meaning.parameters.owner import Owner, a_model
from ic.meaning.parameters.relations import check_names
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.diagnostic import Place
from met.frozen import frozen
from met.plan import LinkSensor, Payload

KIND: Final = "sensor"
USAGE = "write `sensor NAME = MODEL { link = LINK; ... }`"


@frozen
class Sensing:
    """A sensor of the run. rate None: that of the servos. values: of its parameters; empty where one is wrong."""

    name: str
    model: str
    words: tuple[tuple[str, str], ...]
    rate: Rate | None
    values: Mapping[str, Any]
    place: Place

    kind = KIND
    verb = "reads"
    code = "D282"
    ticks = True

    @property
    def label(self) -> str:
        return f"sensor `{self.name}`"

    @property
    def path(self) -> str:
        return f"sensors.{self.name}"

    def use(self, divisor: int) -> LinkSensor:
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
    if item.detail or item.value is None:
        place = item.detail[0].place if item.detail else item.place
        message = (
            f"`{item.detail[0].text}` after the name of a sensor"
            if item.detail
            else (f"sensor `{item.name}` has no model")
        )
        scope.complaints.error("D280", message, place, help=[USAGE, known_words("sensors of links", _of_links())])
        return None
    sensor = find_model(scope, KIND, word_of(item.value), place_of(item.value))
    if sensor is None or refuse_values(scope, item.value, [p.name for p in sensor.parameters]):
        return None
    if sensor.measures is None:
        scope.complaints.error(
            "D281",
            f"`{sensor.name}` is a sensor of a joint, and this is a run",
            place_of(item.value),
            help=[
                f"write `sensor QUANTITY = {sensor.name} {{ ... }}` in a servo, such as of `qd`",
                known_words("sensors of links", _of_links()),
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
    return Sensing(item.name, sensor.name, words_chosen(words, body), rate, values or {}, item.place)


def _of_links() -> list[str]:
    return sorted(name for name, model in models.available(KIND).items() if model.measures is not None)
