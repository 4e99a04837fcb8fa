"""Loops of an arm, `loop NAME { ... }`: a pin closes a chain of three joints, and two of them follow the third."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ic.language.bodies import BRANCH, LEADER, LOOP, PIN_AT, TO_AT
from ic.meaning.definitions.merge import MergedBlock
from ic.meaning.parameters.models import check_keys
from ic.meaning.parameters.owner import Owner, Settled
from ic.meaning.parameters.scope import Scope
from met.plan import Joint, Origin
from met.plan.channel import joint_unit
from met.plan.closing import Corner, axis_across, close, corners_of
from met.plan.loops import Loop, ring
from met.trace import Real, Scalar, absolute, rint
from met.vectors import cross, dot, scale, sub

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
    """The joints of an arm, where two of each loop follow the one that leads; mistakes are reported."""
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
    """Settle where a joint begins that follows by a loop; the first of these reports a loop that does not close."""
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
        plain = value if isinstance(value, Scalar) else float(value)
        scope.parameters[path] = Settled(plain, joint_unit(unit, joint), Origin("derived", joint.place, (), why), why)


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
