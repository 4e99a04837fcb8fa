"""The entry `* = spindle;` in the servos of a run: the servo of every joint without one of its own."""

from __future__ import annotations

from dataclasses import replace

from ic.grammar.expressions import EVERY_JOINT
from ic.meaning.definitions.merge import Item, MergedBlock, overlay
from ic.meaning.mechanics.arm import ResolvedArm
from ic.text.complaints import Complaints
from met.diagnostic import leave_out


def with_other_joints(body: MergedBlock, arm: ResolvedArm, complaints: Complaints) -> MergedBlock:
    """The servos, with an entry for each moving joint that follows no other, in the arm's order; `*` stands for those
    that have none.

    An entry that only changes its servo, `lift { kp = ...; }`, changes that of `*`.
    """
    every = body.get(EVERY_JOINT)
    if every is None:
        return body
    others = {key: item for key, item in body.items.items() if item is not every}
    items, used = {}, False
    for joint in arm.independent:
        own = others.pop(joint.name, None)
        if own is None:
            items[joint.name] = replace(every, name=joint.name)
        else:
            items[joint.name] = own if own.value is not None else _changed(every, own, complaints)
        used = used or own is None or own.value is None
    taken_over = len(every.homes) > 1  # from a run that needs it itself
    if not used and arm.independent and not arm.failed and not taken_over:
        complaints.remark(
            "D287",
            "`*` stands for no joint: each of them has a servo of its own",
            every.place,
            help=leave_out("leave it out"),
        )
    return replace(body, items={**items, **others})


def _changed(every: Item, own: Item, complaints: Complaints) -> Item:
    """The entry of `*` as changed by one joint's entry."""
    body = own.body if every.body is None or own.body is None else overlay(every.body, own.body, complaints)
    return replace(every, name=own.name, body=body, upon=own.place)
