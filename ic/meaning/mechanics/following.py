"""Joints that follow others: `follows`, `ratio` and `offset` of a joint, and where such a joint begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ic.grammar.syntax import List, Name
from ic.language.bodies import OFFSET, RATIO
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.loops import begin_in_loop
from ic.meaning.parameters import not_sweepable
from ic.meaning.parameters.models import value_place
from ic.meaning.parameters.owner import Owner, Settled
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met.diagnostic import Label, did_you_mean, leave_out
from met.plan import Joint, Origin
from met.plan.channel import joint_unit, ratio_unit
from met.plan.following import followed, follows_itself


def leaders_in_words(leaders: Sequence[str]) -> str:
    """Names of joints as messages list them: `shoulder` and `lever`."""
    return " and ".join(f"`{name}`" for name in leaders)


def use_follows(scope: Scope, owner: Owner, body: MergedBlock, arm: MergedBlock) -> tuple[str, ...] | None:
    """The joints that a joint follows, with ratios and offset entered as parameters; none where it moves by itself, and
    None where there is a mistake (already reported). arm: all entries of its arm"""
    item = body.get("follows")
    if item is None:
        for name in ("ratio", "offset"):
            stray = body.get(name)
            freed = any(removal.key == "follows" for removal in body.removed)
            if stray is not None and not freed and not scope.definitions.robot_files.hold(stray.place):
                message = f"{owner.label} has `{name}`, and follows no joint"
                helps = ["write `follows = JOINT;` too", leave_out(f"or leave `{name}` out")]
                scope.complaints.error("D213", message, stray.place, help=helps)
        return ()
    scope.not_sweepable[owner.join("follows")] = not_sweepable.COMPILED_ALONE
    kinds = {
        joint.name: joint.detail[0].text
        for joint in arm.of_kind("joint")
        if joint.detail and joint.name != owner.path and joint.detail[0].text != "fixed"
    }
    leaders = _named(scope, owner, item, kinds)
    if leaders is None:
        return None
    unit = ratio_unit(str(owner.joint), kinds[leaders[0]])
    wanted = replace(RATIO, unit=unit)
    written = body.get("ratio")
    if len(leaders) > 1:
        several = replace(wanted, shape="vector", default=(1.0,) * len(leaders))
        ratios = scope.vector(owner, several, written, names=leaders)
    else:
        ratio = scope.number(owner, wanted, written)
        ratios = None if ratio is None else (ratio,)
    if scope.number(owner, OFFSET, body.get("offset")) is None or ratios is None:
        return None
    return leaders


def _named(scope: Scope, owner: Owner, item: Item, kinds: dict[str, str]) -> tuple[str, ...] | None:
    """The joints that `follows` names, each once and all of one kind. kinds: of the moving joints besides this one"""
    values = item.value.items if isinstance(item.value, List) else (item.value,)
    names = [value.text for value in values if isinstance(value, Name)]
    unknown = [name for name in names if name not in kinds]
    if item.body is not None or item.appended or len(names) != len(values) or not names:
        message, helps = f"`follows` of {owner.label} names a joint, or a list of joints", ["`follows = JOINT;`"]
    elif owner.joint == "fixed":
        message, helps = "a fixed joint follows no other", [leave_out("leave `follows` out")]
    elif unknown == [owner.path]:
        message, helps = f"{owner.label} follows itself", [leave_out("leave `follows` out: it moves by itself")]
    elif unknown:
        message = f"no moving joint `{unknown[0]}` for {owner.label} to follow"
        helps = [*did_you_mean(unknown[0], kinds), known_words("joints that move", kinds)]
        if scope.definitions.robot_files.hold(item.place):
            helps.append(f"in the arm's block, `{owner.path} {{ remove follows; }}` lets it move by itself")
    elif len(set(names)) < len(names):
        message, helps = f"{owner.label} follows a joint twice", ["add the two ratios"]
    elif len({kinds[name] for name in names}) > 1:
        message = f"{owner.label} follows a revolute joint and a prismatic one"
        helps = ["let it follow joints of one kind, whose ratios have one unit"]
    else:
        return tuple(names)
    scope.complaints.error("D213", message, value_place(item), help=helps)
    return None


def check_followers(scope: Scope, joints: Sequence[Joint]) -> None:
    """Report joints that follow each other in a circle."""
    known = {joint.name: joint for joint in joints}
    for joint in joints:
        if joint.place is not None and follows_itself(joint.name, known):
            circle = [known[name] for name in followed(joint.name, known) if name in known and name != joint.name]
            others = [
                follower for follower in circle if follower.place is not None and follows_itself(follower.name, known)
            ]
            scope.complaints.error(
                "D213",
                f"joint `{joint.name}` follows itself by way of others",
                joint.place,
                also=[Label(other.place, "which follows it") for other in others if other.place is not None],
                help="one of them should follow none: that one leads",
            )
            return


def all_led_by(joint: Joint, joints: Sequence[Joint]) -> list[Joint]:
    """The joints that follow a joint, by way of others too."""
    known = {other.name: other for other in joints}
    return [other for other in joints if other is not joint and joint.name in followed(other.name, known)]


def begin_followers(scope: Scope, joints: Sequence[Joint]) -> None:
    """Settle where joints that follow others begin, q and qd, once those that lead are settled."""
    waiting = [joint for joint in joints if joint.follows]
    while waiting:
        ready = [joint for joint in waiting if not {other.name for other in waiting} & set(joint.follows)]
        if not ready:
            return  # in a circle: already reported
        for joint in ready:
            waiting.remove(joint)
            if joint.loop is not None:
                begin_in_loop(scope, joint, joints)
                continue
            for name, unit in (("q", "joint"), ("qd", "joint/s")):
                ratios = [scope.parameters.get(path) for path in joint.ratio_paths.values()]
                leads = [scope.parameters.get(f"initial.{leader}.{name}") for leader in joint.follows]
                offset = scope.parameters.get(f"{joint.name}.offset")
                if None in (*ratios, *leads, offset):
                    scope.checks.fail(f"initial.{joint.name}.{name}")
                    continue
                value = sum(
                    (ratio.value * lead.value for ratio, lead in zip(ratios, leads, strict=True)),  # type: ignore[union-attr, operator]
                    offset.value if name == "q" else 0.0,  # type: ignore[union-attr]
                )
                note = f"from {leaders_in_words(joint.follows)}, which it follows"
                scope.parameters[f"initial.{joint.name}.{name}"] = Settled(
                    value, joint_unit(unit, joint), Origin("derived", joint.place, (), note), note
                )
