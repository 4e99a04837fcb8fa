"""Warnings about a URDF file's arm: omitted parts, a line for each kind; numbers in other units; and changed names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ic.robots.attributes import printable
from ic.robots.doubts import in_other_units
from ic.robots.entries import ArmEntries
from ic.robots.robot import MOVING, Joint
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
        numbers = f"{_count(len(doubtful), 'number')} of `{body.robot.file}`"
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
        more = f", and {len(changed) - MOST_NAMED} more" if len(changed) > MOST_NAMED else ""
        what = f"{_count(len(changed), 'name')} of `{body.robot.file}`"
        yield Diagnostic(
            "D211",
            f"{what} {'is' if len(changed) == 1 else 'are'} another in decks{more}",
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


def _joints(body: ArmEntries, joints: Sequence[Joint]) -> str:
    names = [body.names.joints[joint.name.text] for joint in joints]
    listed = names if len(names) <= MOST_JOINTS else [*names[:2], "...", names[-1]]
    return f"{_count(len(names), 'joint')} ({', '.join(listed)})"


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'s' * (n != 1)}"
