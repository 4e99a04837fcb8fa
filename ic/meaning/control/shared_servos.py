"""Servos without overrides at their joints, resolved once for all joints of one kind, in all runs of a deck.

Such a servo is resolved alone, on a joint that no deck can have. If nothing of it is wrong, worth a remark or made of
what a run sets or varies, a joint that uses it has the same values under its own name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ic.grammar.expressions import EVERY_JOINT
from ic.grammar.syntax import Name
from ic.meaning.definitions.merge import Item, MergedBlock, overlay
from ic.meaning.definitions.resolve import Definition
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters.models import word_of
from ic.meaning.parameters.owner import NotSweepable
from ic.meaning.parameters.scope import Scope
from ic.meaning.parameters.shared import SharedEntries
from ic.text.complaints import Complaints
from met.diagnostic import leave_out
from met.frozen import frozen
from met.plan import Joint

ANY = "\0"
"""The joint on which a shared servo is resolved: no name of a deck has this character."""

Resolve = Callable[[Scope, Item, ResolvedArm], Any]
"""A function that enters the servo of one joint in a scope, and returns its `ic.meaning.control.servos.Use`, None where
there is a mistake."""


@frozen
class SharedServo:
    """A servo in which nothing is wrong, on the joint `ANY`.

    use    as `Resolve` gives it;  entries: of a scope
    heads  of paths by which a run or a sweep may change it, besides its joint's: the definition, and those it is like
    """

    use: Any
    entries: SharedEntries
    heads: tuple[str, ...]


def use_shared(scope: Scope, item: Item, arm: ResolvedArm, resolve: Resolve) -> Any:
    """The servo that an entry of a run's `servos` puts on a joint, entered in the scope; None where it has a mistake
    (already reported). resolve: the function for a single joint, which is passed on"""
    kind = arm.kind(item.name)
    shared = None
    if not item.kind and item.body is None and kind in ("revolute", "prismatic") and not scope.guides:
        shared = _shared(scope, item, kind, resolve)
    if shared is None or not _is_as_written(scope, shared, item.name):
        return resolve(scope, item, arm)

    _renamed(scope, shared, kind or "", item.name).enter(scope)
    return replace(shared.use, joint=item.name, place=item.place, parameters=dict(shared.use.parameters or {}))


def _renamed(scope: Scope, shared: SharedServo, kind: str, joint: str) -> SharedEntries:
    """The servo's entries with their paths on a joint of this kind and name, whichever run has it there."""
    entries, memo, key = shared.entries, scope.definitions.memo, ("servo on joint", shared.heads[0], kind, joint)

    def on_joint(path: str) -> str:
        return path.replace(ANY, joint)

    if key not in memo:
        memo[key] = replace(
            entries,
            parameters={on_joint(path): settled for path, settled in entries.parameters.items()},
            auxiliary={on_joint(path): settled for path, settled in entries.auxiliary.items()},
            known={on_joint(path): list(map(on_joint, parameters)) for path, parameters in entries.known.items()},
            not_sweepable={on_joint(path): _on_joint(why, on_joint) for path, why in entries.not_sweepable.items()},
        )
    renamed: SharedEntries = memo[key]
    return renamed


def _on_joint(why: NotSweepable, on_joint: Callable[[str], str]) -> NotSweepable:
    words = (why.reason, why.sweep, why.one_of, why.setting)
    return NotSweepable(*map(on_joint, words)) if any(ANY in word for word in words) else why


def _shared(scope: Scope, item: Item, kind: str, resolve: Resolve) -> SharedServo | None:
    """The servo for joints of this kind; None where the entry contains more than its name, or there is a mistake or a
    remark."""
    name = scope.definitions.definition_named(item.value) or word_of(item.value)
    definition = scope.definitions.of_kind("servo").get(name or "")
    if not isinstance(item.value, Name) or definition is None:
        return None
    if scope.complaints.is_known_to_lack(definition.place):
        return None
    memo, key = scope.definitions.memo, ("servo", definition.name, kind)
    if key not in memo:
        memo[key] = _alone(scope, item, kind, definition, resolve)
    servo: SharedServo | None = memo[key]
    return servo


def _alone(scope: Scope, item: Item, kind: str, definition: Definition, resolve: Resolve) -> SharedServo | None:
    """A servo resolved at a joint without a name, to be shared by all joints of one kind; None where it has a mistake,
    or depends on its joint."""
    complaints = Complaints()
    alone = Scope(scope.definitions.reporting_to(complaints), complaints)
    arm = ResolvedArm(ANY, (), (Joint(ANY, kind, "", ""),))  # type: ignore[arg-type]  # that of a joint that moves
    use = None
    with complaints.gather():
        use = resolve(alone, replace(item, name=ANY), arm)
    entries = SharedEntries.of(alone)
    if use is None or use.parameters is None or entries is None or not complaints.is_clear:
        return None
    settled = (*alone.parameters.values(), *alone.auxiliary.values())
    if any(ANY in text for parameter in settled for text in (parameter.unit, parameter.doc, parameter.origin.note)):
        return None
    heads = (definition.name, *scope.definitions.homes(definition))
    return SharedServo(use, entries, heads)


def _is_as_written(scope: Scope, shared: SharedServo, joint: str) -> bool:
    """True where neither a sweep nor a setting of the run or from outside changes a number of the servo, or a name in
    one."""
    heads = tuple(f"{head}." for head in (joint, *shared.heads))
    changed = any(f"{path}.".startswith(heads) for path in (*scope.varied, *scope.settings))
    return not changed and shared.entries.has_names_as_written(scope)


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
