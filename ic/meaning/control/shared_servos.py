"""Servos without overrides at their joints, resolved once for all joints of one kind, in all runs of a deck.

Such a servo is resolved alone, on a joint that no deck can have. If nothing of it is wrong, worth a remark or made of
what a run sets or varies, a joint that uses it has the same values under its own name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from ic.grammar.syntax import Name
from ic.meaning.definitions.merge import Item
from ic.meaning.definitions.resolve import Definition
from ic.meaning.expressions.names import FoundNames
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters.models import word_of
from ic.meaning.parameters.not_sweepable import NotSweepable
from ic.meaning.parameters.owner import Settled
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import Complaints
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

    use  as `Resolve` gives it
    parameters, auxiliary, known, not_sweepable  as a scope has them that holds nothing but the servo
    names  what the `let`s that it is made of are worth
    heads  of paths by which a run or a sweep may change it, besides its joint's: the definition, and those it is like
    """

    use: Any
    parameters: Mapping[str, Settled]
    auxiliary: Mapping[str, Settled]
    known: Mapping[str, list[str]]
    not_sweepable: Mapping[str, NotSweepable]
    names: FoundNames
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

    here = _renamed(scope, shared, kind or "", item.name)
    scope.parameters |= here.parameters
    scope.auxiliary |= here.auxiliary
    for path, parameters in here.known.items():
        scope.known.setdefault(path, []).extend(parameters)
    for path, why in here.not_sweepable.items():
        scope.not_sweepable.setdefault(path, why)
    scope.names.take_over(shared.names)
    return replace(shared.use, joint=item.name, place=item.place, parameters=dict(shared.use.parameters or {}))


def _renamed(scope: Scope, shared: SharedServo, kind: str, joint: str) -> SharedServo:
    """The servo with the paths that it has on a joint of this kind and name, whichever run has it there."""
    memo, key = scope.definitions.memo, ("servo on joint", shared.heads[0], kind, joint)

    def on_joint(path: str) -> str:
        return path.replace(ANY, joint)

    if key not in memo:
        memo[key] = replace(
            shared,
            parameters={on_joint(path): settled for path, settled in shared.parameters.items()},
            auxiliary={on_joint(path): settled for path, settled in shared.auxiliary.items()},
            known={on_joint(path): list(map(on_joint, parameters)) for path, parameters in shared.known.items()},
            not_sweepable={on_joint(path): _on_joint(why, on_joint) for path, why in shared.not_sweepable.items()},
        )
    found: SharedServo = memo[key]
    return found


def _on_joint(why: NotSweepable, on_joint: Callable[[str], str]) -> NotSweepable:
    words = (why.reason, why.sweep, why.one_of, why.setting)
    return NotSweepable(*map(on_joint, words)) if any(ANY in each for each in words) else why


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
    found: SharedServo | None = memo[key]
    return found


def _alone(scope: Scope, item: Item, kind: str, definition: Definition, resolve: Resolve) -> SharedServo | None:
    complaints = Complaints()
    alone = Scope(scope.definitions.reporting_to(complaints), complaints)
    arm = ResolvedArm(ANY, (), (Joint(ANY, kind, "", ""),))  # type: ignore[arg-type]  # that of a joint that moves
    use = None
    with complaints.gather():
        use = resolve(alone, replace(item, name=ANY), arm)
    plain = not (alone.notes or alone.targets or alone.removed or alone.joint_kinds)
    if use is None or use.parameters is None or not (plain and complaints.is_clear and alone.checks.is_clear):
        return None
    settled = (*alone.parameters.values(), *alone.auxiliary.values())
    if any(ANY in text for each in settled for text in (each.unit, each.doc, each.origin.note)):
        return None
    heads = (definition.name, *scope.definitions.homes(definition))
    return SharedServo(
        use, alone.parameters, alone.auxiliary, alone.known, alone.not_sweepable, alone.names.found, heads
    )


def _is_as_written(scope: Scope, shared: SharedServo, joint: str) -> bool:
    """True where neither a sweep nor a setting of the run or from outside changes a number of the servo, or a name in
    one."""
    given = {*scope.varied, *scope.settings}
    if not given:
        return True
    named = shared.names.named
    heads = tuple(f"{head}." for head in (joint, *shared.heads))
    lets = scope.definitions.lets
    return (
        given.isdisjoint(named)
        and not any(f"{path}.".startswith(heads) for path in given)
        and not any("." in name and name not in lets for name in named)
        and not any(path.partition(".")[0] in named for path in given)
    )
