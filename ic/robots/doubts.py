"""What a URDF file says that is hardly meant: numbers that look like degrees or mm, and inertia without a product."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ic.robots.attributes import printable
from ic.robots.entries import spelled
from ic.robots.robot import Numbers, Robot
from ic.robots.urdf import MOMENTS
from met.diagnostic import Label

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
