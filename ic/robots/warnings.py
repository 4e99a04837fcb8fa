"""Warnings about a URDF file's arm: omitted parts, a line for each kind; numbers that look like degrees or mm;
and changed names. A deck that `met import` makes says the doubts about numbers in comments.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ic.robots.attributes import printable
from ic.robots.entries import ArmEntries, spelled
from ic.robots.robot import MOVING, Numbers, Robot, RobotJoint
from ic.robots.urdf import MOMENTS
from ic.text.complaints import and_more, counted
from met.diagnostic import Diagnostic, Label, Place

MOST_NAMED = 8  # names, kinds of elements
MOST_JOINTS = 4  # in a line; of more the first and the last


def warnings_of(body: ArmEntries, named: Place) -> Iterator[Diagnostic]:
    """The warnings. named: where the deck names the file"""
    labels = list(_left_out(body))
    if labels:
        yield Diagnostic(
            "D210",
            f"not all that `{body.robot.file}` says is in this arm",
            Label(named),
            tuple(labels),
            ("`met import` makes a deck of such a file, with friction beside each joint",),
            "warning",
        )
    doubtful = tuple(in_other_units(body.robot))
    if doubtful:
        numbers = f"{counted(len(doubtful), 'number')} of `{body.robot.file}`"
        yield Diagnostic(
            "D218",
            f"{numbers} {'looks' if len(doubtful) == 1 else 'look'} like another unit",
            Label(named),
            doubtful[:MOST_NAMED],
            ("URDF has radians and metres: correct the file",),
            "warning",
        )
    changed = body.names.changed
    if changed:
        also = tuple(
            Label(change.written.place, f"{change.kind} `{printable(change.written.text)}` is `{change.name}`")
            for change in changed[:MOST_NAMED]
        )
        what = f"{counted(len(changed), 'name')} of `{body.robot.file}`"
        yield Diagnostic(
            "D211",
            f"{what} {'is' if len(changed) == 1 else 'are'} another in decks{and_more(len(changed) - MOST_NAMED)}",
            Label(named),
            also,
            ("a deck's names are letters, digits and `_`, each once",),
            "warning",
        )


def _left_out(body: ArmEntries) -> Iterator[Label]:
    """Labels about parts of a robot's file that a deck's arm does not take over, one for each kind."""
    robot = body.robot
    rubbing = [joint for joint in robot.joints if joint.friction_at is not None and joint.type.text in MOVING]
    if rubbing and rubbing[0].friction_at is not None:
        yield Label(
            rubbing[0].friction_at,
            f"damping and friction of {_joints(body, rubbing)}: a servo has these, such as `passive`",
        )
    if robot.dropped:
        kinds = sorted(robot.dropped.items(), key=lambda kind: (-len(kind[1]), kind[0]))
        counts = [f"{len(elements)} `{printable(what)}`" for what, elements in kinds[:MOST_NAMED]]
        more = f" and {len(kinds) - MOST_NAMED} kinds more" if len(kinds) > MOST_NAMED else ""
        yield Label(kinds[0][1][0].place, f"not read: {', '.join(counts)}{more}")
    for reason, elements in robot.unseen.items():
        yield Label(elements[0].place, f"{unseen_words(len(elements))} {reason}")


def unseen_words(count: int) -> str:
    return f"not drawn: {count} mesh{'es' * (count != 1)}"


def _joints(body: ArmEntries, joints: Sequence[RobotJoint]) -> str:
    names = [body.names.joints[joint.name.text] for joint in joints]
    listed = names if len(names) <= MOST_JOINTS else [*names[:2], "...", names[-1]]
    return f"{counted(len(names), 'joint')} ({', '.join(listed)})"


MOST_TURNS = 2  # of an end of a joint's range: cables allow hardly more
MOST_DEGREES = 720.0  # the same in degrees; what is above, such as 1e16, is written for no limit
MOST_TRAVEL = 50.0  # m; of an end of a sliding joint's range: published robots have 15 m at most
MOST_SPEED = {"revolute": 60.0, "continuous": 60.0, "prismatic": 20.0}  # rad/s, m/s; published robots have 60 and 5


def in_other_units(robot: Robot) -> Iterator[Label]:
    """Each number that is far from usual in URDF's unit, and usual in degrees or mm, in words that stand alone.

    A power of ten is written for no limit: in 128 published robots each velocity above 60 rad/s is one.
    """
    for link in robot.links:
        if link.inertial is not None:
            yield from _turned(link.inertial.rpy, f"the inertia of link `{printable(link.name.text)}`")
    for joint in robot.joints:
        name = f"joint `{printable(joint.name.text)}`"
        if not joint.held:  # which is in the `rpy` of a follower that is fixed
            yield from _turned(joint.rpy, name)
        for end in ("lower", "upper") if joint.type.text == "revolute" else ():
            limit = joint.limits.get(end)
            if limit is not None and MOST_TURNS * 2.0 * math.pi < abs(limit.values[0]) <= MOST_DEGREES:
                yield _degrees(limit, limit.values[0], f"`{end}` of {name}")
        slides = joint.type.text == "prismatic"
        speed, usual_speed = ("m/s", "mm/s") if slides else ("rad/s", "deg/s")
        for attribute, most, unit, usual in (
            *(((end, MOST_TRAVEL, "m", "mm") for end in ("lower", "upper")) if slides else ()),
            ("velocity", MOST_SPEED.get(joint.type.text, math.inf), speed, usual_speed),
        ):
            limit = joint.limits.get(attribute)
            if limit is not None and most < abs(limit.values[0]) < math.inf and not _power_of_ten(limit.values[0]):
                value = spelled(limit.values[0])
                yield Label(limit.place, f"`{attribute}` of {name} is {value} {unit}: is it in {usual}?")


def _power_of_ten(value: float) -> bool:
    return math.log10(abs(value)).is_integer()


def _turned(rpy: Numbers | None, owner: str) -> Iterator[Label]:
    largest = max(rpy.values, key=abs) if rpy is not None else 0.0
    if rpy is not None and abs(largest) > 2.0 * math.pi + 0.01:
        yield _degrees(rpy, largest, f"`rpy` of {owner}")


def _degrees(numbers: Numbers, value: float, what: str) -> Label:
    turns = f"{abs(value) / (2.0 * math.pi):.1f} turns"
    return Label(numbers.place, f"{what} is {spelled(value)} rad, {turns}: is it in degrees?")


def incomplete(robot: Robot) -> Iterator[str]:
    """A line on each inertia that leaves numbers out."""
    for link in robot.links:
        if link.inertial is not None:
            moments = link.inertial.moments
            missing = [
                f"`{moment}`" for moment, place in zip(MOMENTS, moments.places, strict=False) if place == moments.place
            ]
            if missing:
                yield f"the inertia of link `{printable(link.name.text)}` has no {', '.join(missing)}: taken as 0"
