"""Joints that follow others: by `follows`, or by a loop, `loop NAME { ... }`, whose pin closes a chain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ic.grammar.syntax import List, Name
from ic.language.bodies import BRANCH, LEADER, LOOP, OFFSET, PIN_AT, RATIO, TO_AT
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.expressions.quantity import as_float
from ic.meaning.parameters.models import check_keys
from ic.meaning.parameters.owner import COMPILED_ALONE, Owner, Settled
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met.diagnostic import Label, did_you_mean, leave_out
from met.plan import Joint, Origin
from met.plan.channel import joint_unit, ratio_unit
from met.plan.closing import Corner, Loop, axis_across, close, corners_of, ring
from met.plan.following import followed, follows_itself
from met.trace import Real, Scalar, absolute, rint
from met.vectors import cross, dot, scale, sub


def leaders_in_words(leaders: Sequence[str]) -> str:
    """Names of joints as messages list them: `shoulder` and `lever`."""
    return " and ".join(f"`{name}`" for name in leaders)


def use_follows(scope: Scope, owner: Owner, body: MergedBlock, arm: MergedBlock) -> tuple[str, ...] | None:
    """The joints that a joint's motion follows from (`follows`), with ratios and offset entered as parameters; none
    where it moves by itself, and None where there is a mistake (already reported). arm: all entries of its arm"""
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
    scope.not_sweepable[owner.join("follows")] = COMPILED_ALONE
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
    scope.complaints.error("D213", message, item.value_place, help=helps)
    return None


def check_followers(scope: Scope, joints: Sequence[Joint]) -> None:
    """Report joints that are each made to follow the other, in a circle."""
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
    """Settle position and rate at the start of joints that follow others (by ratios and an offset), once those are
    settled."""
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


SOFTLY = "a `bushing` of the environment closes any chain softly (`met doc bushing`)"
PLANE = "its revolute joints have parallel axes; a joint that slides, and the pin, stay in a plane across them"
TOLERANCE = 1e-9
"""Of a direction, or m, by which the joints of a loop may miss its plane: rounding of decimals."""

POSES = 4001
"""Positions of a leader at which a loop is tried, to say where it closes."""


def resolve_loop(scope: Scope, owner: Owner, body: MergedBlock, link: str | None, to: str | None) -> tuple[Loop, ...]:
    """A loop, with the numbers of its pin entered as parameters; none where there is a mistake (already reported).

    link, to  the links that its pin holds together
    """
    check_keys(scope, body, LOOP.keys, owner)
    points = [scope.vector(owner, wanted, body.get(wanted.name)) for wanted in (PIN_AT, TO_AT)]
    leader, branch = (scope.word(owner, wanted, body.get(wanted.name)) for wanted in (LEADER, BRANCH))
    if None in (leader, link, to, branch, *points):
        return ()
    for key, value in (("leader", leader), ("link", link), ("to", to), ("branch", branch)):
        scope.keep_in_deck(owner.join(key), value, body.items[key])  # type: ignore[arg-type]
    return (Loop(owner.path, leader, link, to, branch, owner.place),)  # type: ignore[arg-type]


def close_loops(scope: Scope, joints: Sequence[Joint], loops: Sequence[Loop]) -> list[Joint]:
    """The joints of an arm with loops, each of which makes two of its joints follow from the one that leads; mistakes
    are reported."""
    by_name = {joint.name: joint for joint in joints}
    for loop in loops:
        names = [joint.name for joint, _ in ring(loop, joints)]
        followers = [by_name[name] for name in names if name != loop.leader]
        wrong = next((joint for joint in followers if joint.kind == "prismatic" or joint.follows), None)
        listed = ", ".join(f"`{name}`" for name in names)
        if len(names) != 3:
            message = f"loop `{loop.name}` closes {len(names)} moving joints{': ' * bool(names)}{listed}"
            helps = [f"between `{loop.link}` and `{loop.to}` it has three, and fixed ones besides", SOFTLY]
        elif loop.leader not in names:
            message, helps = f"`{loop.leader}` is no joint of loop `{loop.name}`", [f"its joints are {listed}"]
        elif loop.name in by_name:
            message, helps = f"a joint is called `{loop.name}` too", ["give the loop another name"]
        elif wrong is not None and wrong.follows:
            message = f"joint `{wrong.name}` would follow twice, once by loop `{loop.name}`"
            helps = ["leave one of the two out, or let another joint lead"]
        elif wrong is not None:
            message = f"joint `{wrong.name}` slides, and would follow by loop `{loop.name}`"
            helps = [f"let it lead: `leader = {wrong.name};`"] * (by_name[loop.leader].kind != "prismatic") + [SOFTLY]
        else:
            by_name |= {joint.name: replace(joint, follows=(loop.leader,), loop=loop) for joint in followers}
            continue
        assert loop.place is not None  # a loop of a deck has one
        scope.complaints.error("D213", message, loop.place, help=helps)
    return list(by_name.values())


def begin_in_loop(scope: Scope, joint: Joint, joints: Sequence[Joint]) -> None:
    """Settle where a joint begins whose position follows from a loop's leader; the first of these reports a loop that
    does not close."""
    loop = joint.loop
    assert loop is not None

    def number(path: str) -> Real:
        no_pivot = ".pivot." in path and path not in scope.parameters
        return 0.0 if no_pivot else scope.parameters[path].value  # type: ignore[return-value]

    try:
        corners = corners_of(loop, joints, number)
        q, qd = (scope.parameters[f"initial.{loop.leader}.{name}"].value for name in ("q", "qd"))
    except KeyError:  # already reported
        for name in ("q", "qd"):
            scope.checks.fail(f"initial.{joint.name}.{name}")
        return
    with np.errstate(all="ignore"):
        followers, sides = close(corners, q, left=loop.branch == "left")  # type: ignore[arg-type]
        led = followers[joint.name]
        if joint.name == next(other.name for other in joints if other.loop is loop):
            _check(scope, loop, corners, q, (led.ratio, *sides))  # type: ignore[arg-type]
    ends = [
        scope.parameters[path].value
        for end in ("q_min", "q_max")
        if (path := f"{joint.name}.{end}") in scope.parameters
    ]
    middle = 0.5 * (ends[0] + ends[1]) if len(ends) == 2 else 0.0  # type: ignore[operator]
    turns = -2.0 * math.pi * rint((led.q - middle) / (2.0 * math.pi))
    note = f"from `{loop.leader}`, which it follows by loop `{loop.name}`"
    for path, value, unit, why in (
        (
            f"{joint.name}.offset",
            turns,
            "joint",
            "whole turns, so that it begins within 180 deg of the middle of its range, or of 0",
        ),
        (f"initial.{joint.name}.q", led.q + turns, "joint", note),
        (f"initial.{joint.name}.qd", led.ratio * qd, "joint/s", note),  # type: ignore[operator]
    ):
        origin = Origin("derived", joint.place, (), why)
        scope.parameters[path] = Settled(as_float(value), joint_unit(unit, joint), origin, why)


def _check(scope: Scope, loop: Loop, corners: Sequence[Corner], q: Real, closed: tuple[Real, ...]) -> None:
    """Report a loop that is not in one plane, and one that does not close where its leader begins, at q.

    closed  a ratio, not a number where it does not close; and the sides of its triangle, m
    """
    assert loop.place is not None  # a loop of a deck has one
    across, names, off = axis_across(corners), [], []
    for corner in corners:
        leaves = cross(corner.axis, across) if corner.kind == "revolute" else scale(dot(corner.axis, across), across)
        along = dot(sub(corner.before, corner.after), across)
        off.append(dot(leaves, leaves) + along * along)
        names.append(f"joint `{corner.name}`" if corner.name else "the pin")

    def leaves_plane(table: np.ndarray) -> tuple[np.ndarray, list[str]]:
        return table.max(axis=1) > TOLERANCE**2, [f"by {names[int(np.argmax(table.max(axis=0)))]}"]

    def opens(table: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """True of each case in which a loop does not close, and the reason in words. table: [case, 4], the last three
        the sides of the loop's triangle, m"""
        bad = np.isnan(table[:, 0])
        v, p, r = table[np.argmax(bad), 1:]
        if not (p > 0.0 and r > 0.0):
            return bad, ["two of its corners are one point"]
        reach = f"and the links reach from {abs(p - r):.4g} to {p + r:.4g} m"
        flat = ": there it is flat" if abs(p - r) < v * (1.0 + TOLERANCE) and v < (p + r) * (1.0 + TOLERANCE) else ""
        return bad, [f"from {names[3]} to {names[1]} there are {v:.4g} m, {reach}{flat}"]

    for values, test, message, helps in (
        (tuple(off), leaves_plane, "leaves its plane", (PLANE, SOFTLY)),
        (closed, opens, "does not close where its leader begins", (_where_it_closes(loop, corners, q, closed),)),
    ):
        scope.checks.require(
            values,
            test,
            code="D213",
            message=f"loop `{loop.name}` {message}",
            place=loop.place,
            path=loop.name,
            needs=(loop.name,),
            help=helps,
        )


def _where_it_closes(loop: Loop, corners: Sequence[Corner], q: Real, closed: tuple[Real, ...]) -> str:
    """The help with the position of the leader nearest to q at which a loop closes."""
    reach, closes = sum(closed[1:], math.pi + absolute(q)), np.empty(0)
    if not isinstance(reach, Scalar):
        tried = np.linspace(-reach, reach, POSES)
        ratios: Any = [led.ratio for led in close(corners, tried, left=True)[0].values()]  # type: ignore[arg-type]
        closes = tried[np.isfinite(ratios[0])]
    if not len(closes):
        return "change where its leader begins, or where its joints or its points are"
    best, unit = closes[np.argmin(np.abs(closes - q))], "rad" if corners[0].kind == "revolute" else "m"
    return f"it closes at `initial {{ {loop.leader}.q = {best:.4g} {unit}; }}`, the nearest"
