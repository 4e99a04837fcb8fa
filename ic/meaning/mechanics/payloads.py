"""Payloads: `payload NAME { mass = ...;  on = LINK; }`, bodies that a link carries, grapples or releases."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from ic.grammar.syntax import Name
from ic.language.bodies import ATTITUDE, GRAPPLE, PAYLOAD, PAYLOAD_AT, PAYLOAD_RPY, POSITION, RATE, RELEASE, VELOCITY
from ic.meaning.definitions.merge import Item, MergedBlock, no_block
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.mechanics.matter import use_matter
from ic.meaning.parameters.models import check_keys
from ic.meaning.parameters.owner import COMPILED_ALONE, NotSweepable, Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met.diagnostic import Label, Place, did_you_mean, leave_out
from met.parameter import WORLD
from met.plan import BASE, INSTANT, Payload, Structure
from met.plan.defaults import INERTIA
from met.trace import Real

EVENTS = (GRAPPLE, RELEASE)
FLIGHT = (POSITION, ATTITUDE, VELOCITY, RATE)
USAGE = "write `payload NAME { mass = 20 kg;  shape = sphere(radius = 0.2 m);  on = LINK; }`"


def resolve_payloads(scope: Scope, block: MergedBlock, arm: ResolvedArm) -> tuple[Payload, ...]:
    """The payloads of a run, in the deck's order, their numbers entered as parameters; mistakes are reported."""
    payloads: list[Payload] = []
    for item in block.of_kind("payload"):
        with scope.complaints.gather():
            taken = (BASE, WORLD, *(link.name for link in arm.links))
            payloads.append(_payload(scope, item, arm, taken))
    return tuple(payloads)


def check_payloads(scope: Scope, block: MergedBlock, structure: Structure) -> None:
    """Check payloads against the rest of the run: whether they may be free bodies, and the times of their events."""
    items = {item.name: item for item in block.of_kind("payload")}
    for payload in structure.payloads:
        item = items[payload.name]
        if payload.flies and not structure.velocity_products:
            scope.complaints.error(
                "D266",
                f"payload `{payload.name}` flies by velocity products, and they are off",
                item.place,
                help="leave `velocity_products = off` out",
            )
        for wanted in EVENTS:
            written = (item.body or MergedBlock()).get(wanted.name)
            settled = scope.parameters.get(f"payloads.{payload.name}.{wanted.name}")
            if written is not None and settled is not None and isinstance(settled.value, float):
                _remark_time(scope, payload, wanted.name, settled.value, structure, written.value_place)


def _payload(scope: Scope, item: Item, arm: ResolvedArm, taken: Collection[str]) -> Payload:
    """One payload, its numbers entered as parameters; mistakes are reported."""
    owner = Owner(f"payload `{item.name}`", item.place, f"payloads.{item.name}", homes=item.homes)
    if item.detail or item.value is not None or item.body is None:
        place = item.detail[0].place if item.detail else item.value_place
        scope.complaints.error("D260", "`payload` takes a name, and a block", place, help=USAGE)
        scope.checks.fail(owner.path)
        return Payload(item.name, BASE, place=item.place)
    if item.name in taken:
        what = {BASE: "what the arm stands on", WORLD: "the ground"}.get(item.name, f"a link of arm `{arm.name}`")
        scope.complaints.error(
            "D262",
            f"`{item.name}` is {what}, so no payload may be called so",
            item.place,
            help="give the payload another name",
        )
    body = item.body
    check_keys(scope, body, PAYLOAD.keys, owner)
    shape = use_matter(scope, owner, "payload", item.name, body)
    link = _link(scope, owner, body.get("on"), arm)
    grappled, released = (body.get(wanted.name) is not None for wanted in EVENTS)
    _check_unused(scope, item, body, grappled)
    scope.vector(owner, PAYLOAD_AT, body.get("at"))
    if not grappled:
        scope.vector(owner, PAYLOAD_RPY, body.get("rpy"))
    for wanted in FLIGHT if grappled else ():
        scope.vector(owner, wanted, body.get(wanted.name))
    times = [scope.number(owner, wanted, entry) for wanted in EVENTS if (entry := body.get(wanted.name)) is not None]
    for wanted in EVENTS:
        if body.get(wanted.name) is None:
            scope.not_sweepable[owner.join(wanted.name)] = NotSweepable(
                "is not written, and so decides the program",
                f"write `{wanted.name} = ...;` in the payload, and it varies",
                setting=f"write `{wanted.name} = ...;` in the payload, and it can be set",
            )
    payload = Payload(item.name, link or BASE, grappled, released, item.place, shape)
    if grappled and released:
        _check_order(scope, item, times, body.items["release"].value_place)
    if payload.flies:
        _check_solid(scope, owner, payload, item)
    scope.keep_setting(owner.join("on"), link or BASE, item=body.get("on"))
    scope.not_sweepable[owner.join("on")] = COMPILED_ALONE
    return payload


def _link(scope: Scope, owner: Owner, item: Item | None, arm: ResolvedArm) -> str | None:
    """The carrying link, as written; None where the arm has no such link (already reported)."""
    known = [BASE, *(link.name for link in arm.links if link.name != BASE)]
    if item is None:
        scope.complaints.missing(
            owner.place,
            ("on",),
            "D261",
            f"{owner.label} is on no link",
            help=["write `on = LINK;`, the link that carries or grapples it", known_words("links", known)],
        )
        return None
    if item.upon is not None:
        scope.complaints.add(no_block(item.name, item.upon, item.place))
        return None
    name = item.value.text if isinstance(item.value, Name) else None
    if name in known or name in arm.failed:
        return name if name in known else None
    message = (
        f"no link `{name}` in arm `{arm.name}`" if name is not None else f"a link's name is needed for {owner.label}"
    )
    scope.complaints.error(
        "D261",
        message,
        item.value_place,
        help=[*(did_you_mean(name, known) if name else ()), known_words("links", known)],
    )
    return None


def _check_unused(scope: Scope, item: Item, body: MergedBlock, grappled: bool) -> None:
    """Report entries without meaning for a payload that is held from the start, or that is caught in flight."""
    for name in ("rpy",) if grappled else tuple(parameter.name for parameter in FLIGHT):
        written = body.get(name)
        if written is None:
            continue
        message, helps = (
            f"payload `{item.name}` is held from the start",
            [
                leave_out(f"leave `{name}` out: `at` and `rpy` say where on its link it is"),
                "or write `grapple = 3 s;` if it flies first",
            ],
        )
        also = []
        if grappled:
            message, helps = (
                f"payload `{item.name}` is held as it is when it is grappled",
                [
                    leave_out(f"leave `{name}` out: `attitude` and `rate` say how it flies before"),
                    "or leave `grapple` out if it is held from the start",
                ],
            )
            also = [Label(body.items["grapple"].place, "grappled here")]
        scope.complaints.error("D263", f"{message}, so `{name}` has no effect", written.place, also=also, help=helps)


def _check_order(scope: Scope, item: Item, times: list[Real | None], place: Place) -> None:
    """Check that a payload is released after it is grappled, in every case (D264). times: of both, s."""
    grapple, release = times
    if grapple is None or release is None:
        return
    head = f"payloads.{item.name}"
    scope.checks.require(
        (grapple, release),
        _not_in_order,
        code="D264",
        path=f"{head}.release",
        message=f"payload `{item.name}` is not released after it is grappled",
        place=place,
        needs=(f"{head}.grapple", f"{head}.release"),
        help="write a later `release`, or an earlier `grapple`",
    )


def _check_solid(scope: Scope, owner: Owner, payload: Payload, item: Item) -> None:
    """Check that a payload that is a free body for a time has mass, and inertia about every axis."""
    paths = [owner.join("mass"), *(owner.join(f"inertia.{entry}") for entry in INERTIA)]
    settled = [scope.parameters.get(path) for path in paths]
    if any(setting is None or isinstance(setting.value, str | tuple) for setting in settled):
        return
    body = item.body or MergedBlock()
    cause = next((part for name in ("inertia", "shape", "mass") if (part := body.get(name)) is not None), item)
    helps = (
        "what flies has mass, and resists a turn about every axis: a box, a cylinder or a sphere does",
        "or leave `grapple` and `release` out: then it is a part of its link",
    )
    scope.checks.require(
        tuple(setting.value for setting in settled if setting is not None),  # type: ignore[misc]  # numbers, by the test above
        _not_solid,
        code="D265",
        place=cause.value_place,
        help=helps,
        needs=(*paths, f"{owner.path}.shape"),
        message=f"payload `{payload.name}` is no body that could fly",
    )


def _not_in_order(pairs: np.ndarray) -> tuple[np.ndarray, list[str]]:
    bad = ~(pairs[:, 0] < pairs[:, 1])
    return bad, [f"{release:g} s is not after {grapple:g} s" for grapple, release in pairs[bad][:1]]


def _not_solid(values: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The rows [n, 7], mass and moments, of bodies that cannot move freely, as a mask, and the reason in words."""
    mass, xx, yy, zz, xy, xz, yz = values.T
    least, _, most = np.linalg.eigvalsh(np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(-1, 3, 3)).T
    bad = ~((mass > 0.0) & (least > 1e-9 * most))
    causes = [
        "it has no mass" if not mass[row] > 0.0 else f"its smallest principal moment is {least[row]:.6g} kg*m^2"
        for row in np.flatnonzero(bad)[:1]
    ]
    return bad, causes


def _remark_time(scope: Scope, payload: Payload, event: str, time: float, structure: Structure, place: Place) -> None:
    """Report events after the run's end, and times between the instants of the dynamics."""
    schedule = structure.schedule
    does = f"payload `{payload.name}` is {event}d"
    if time > schedule.duration:
        scope.complaints.remark(
            "D268",
            f"{does} at {time:g} s, and the run ends at {schedule.duration:g} s",
            place,
            help=leave_out(f"leave `{event}` out, or let the run last longer")
            if event == "release"
            else "let the run last longer, or leave it: then the payload flies by",
        )
        return
    next_instant = schedule.step * math.ceil(time / schedule.step - INSTANT)
    if next_instant - time > INSTANT * schedule.step:
        scope.complaints.remark(
            "D267",
            f"{does} at {next_instant:.9g} s: {time:.9g} s is no instant of the dynamics",
            place,
            help=f"a step of the dynamics is {schedule.step:g} s; write a multiple of it",
        )
