"""Loops of three joints and a pin, by which two of the joints follow the third."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from met.diagnostic import Place
from met.frozen import frozen, keyed

if TYPE_CHECKING:
    from met.plan import Joint


@frozen
class Loop:
    """A pin that holds a point of one link on a point of another, and so closes a chain of three joints.

    leader  the joint that leads; the other two are revolute, and follow it
    branch  of the two ways to put the links together: whether the corners behind the leader, in the direction from
            the pin through `link`, turn left or right about the axis of the first joint among them
    """

    name: str
    leader: str
    link: str
    to: str
    branch: Literal["left", "right"]
    place: Place | None = keyed("never", default=None)


def ways(loop: Loop, joints: Sequence[Joint]) -> tuple[list[Joint], list[Joint]]:
    """The joints from the nearest link that carries both links of a loop out to each of them, fixed ones too."""
    carriers = {joint.child: joint for joint in joints}
    inward: list[Joint] = []
    outward: list[Joint] = []
    for link, chain in ((loop.link, inward), (loop.to, outward)):
        while link in carriers and carriers[link] not in chain:  # a broken tree is reported elsewhere
            chain.insert(0, carriers[link])
            link = chain[0].parent
    shared = sum(a is b for a, b in zip(inward, outward, strict=False))
    return inward[shared:], outward[shared:]


def ring(loop: Loop, joints: Sequence[Joint]) -> tuple[tuple[Joint, int], ...]:
    """The moving joints of a loop in their order from the pin through `link` to `to`: each with 1 where it is passed
    from its parent to its child, else -1."""
    inward, outward = ways(loop, joints)
    passed = [*((joint, -1) for joint in reversed(inward)), *((joint, 1) for joint in outward)]
    return tuple((joint, along) for joint, along in passed if joint.kind != "fixed")


def of_joints(joints: Sequence[Joint]) -> dict[str, Loop]:
    """The loops of an arm, by name."""
    return {joint.loop.name: joint.loop for joint in joints if joint.loop is not None}


def in_loops(joints: Sequence[Joint]) -> dict[str, Loop]:
    """By each joint of a loop, the loop."""
    return {joint.name: loop for loop in of_joints(joints).values() for joint, _ in ring(loop, joints)}
