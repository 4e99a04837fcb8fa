"""Joints that follow others in a URDF file, freed or held in a deck that is not to have them follow.

A follower is at `multiplier` times the position of its leader plus `offset`, and the leader is where the deck's first
run holds it (`hold_position`): at 0, or in the middle of a range that 0 is not in.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from ic.robots.entries import limits, rotation, rpy_of, spelled
from ic.robots.robot import MOVING, Numbers, Robot, RobotJoint

Treatment = Literal["follow", "free", "fixed"]


def without_mimics(robot: Robot, treatment: Treatment) -> Robot:
    """The robot with its followers freed, or fixed where they are; `print_deck` names them."""
    known = {joint.name.text: joint for joint in robot.joints}

    def changed(joint: RobotJoint) -> RobotJoint:
        """A joint that imitates another, free or held where it is; others as they are."""
        if joint.mimic is None:
            return joint
        free = replace(joint, mimic=None, followed=joint.mimic)
        if treatment == "free":
            return free
        held_at = position(joint, known)
        return replace(_fixed(free, held_at), beyond=_beyond(joint, held_at))

    return replace(robot, joints=tuple(changed(joint) for joint in robot.joints))


def position(joint: RobotJoint, known: dict[str, RobotJoint]) -> float:
    """The position of a joint at the start, rad or m; a follower is where its leader puts it. known: all joints by
    name"""
    chain = [joint]
    while (mimic := chain[-1].mimic) is not None:
        chain.append(known[mimic.joint.text])
    value = hold_position(chain[-1])
    for follower in reversed(chain[:-1]):
        assert follower.mimic is not None
        value = follower.mimic.multiplier * value + follower.mimic.offset
    return value + 0.0


def _beyond(joint: RobotJoint, value: float) -> str:
    """The limits that a position is beyond, in words: `its limits, -1.5 to 1.5`; "" within them."""
    ends = {name: limit.values[0] for name, limit in limits(joint).items()}
    lower, upper = ends.get("lower", -math.inf), ends.get("upper", math.inf)
    return "" if lower <= value <= upper else f"its limits, {spelled(lower)} to {spelled(upper)}"


def hold_position(joint: RobotJoint) -> float:
    """The position at which a deck's first run holds a joint: the file's, else 0, or the middle of its range where that
    excludes 0."""
    if joint.type.text not in MOVING:
        return 0.0
    if joint.start is not None:
        return joint.start
    ends = {name: limit.values[0] for name, limit in limits(joint).items()}
    lower, upper = ends.get("lower", -math.inf), ends.get("upper", math.inf)
    if lower <= 0.0 <= upper or not lower < upper < math.inf:  # else the arm is refused
        return 0.0
    middle = lower / 2.0 + upper / 2.0  # the sum might overflow
    short = float(f"{middle:.4g}")
    return short if lower <= short <= upper else middle


def _fixed(joint: RobotJoint, value: float) -> RobotJoint:
    """The joint made a fixed one, whose child lies where it would at this position (m or rad)."""
    fixed = replace(joint, type=replace(joint.type, text="fixed"), axis=None)
    if joint.type.text not in MOVING or value == 0.0:
        return fixed
    axis = (1.0, 0.0, 0.0) if joint.axis is None else joint.axis.values
    length = math.hypot(*axis)
    if length == 0.0:  # no direction to move in
        return fixed
    x, y, z = (component / length for component in axis)
    place = joint.name.place
    rpy = (0.0, 0.0, 0.0) if joint.rpy is None else joint.rpy.values
    if joint.type.text == "prismatic":
        R = rotation(*rpy)
        moved = (sum(row[k] * value * (x, y, z)[k] for k in range(3)) for row in R)
        start = (0.0, 0.0, 0.0) if joint.at is None else joint.at.values
        origin = tuple(a + b for a, b in zip(start, moved, strict=True))
        return replace(fixed, at=Numbers(origin, place if joint.at is None else joint.at.place), held=value)
    turned = _turned(rpy, (x, y, z), value)
    return replace(fixed, rpy=Numbers(turned, place if joint.rpy is None else joint.rpy.place), held=value)


def _turned(rpy: tuple[float, ...], axis: tuple[float, float, float], angle: float) -> tuple[float, float, float]:
    """rpy of a frame at `rpy` that is then turned about an axis of its own; exact about x, and of a frame not turned
    about any of its axes."""
    along = [k for k in range(3) if axis[k] != 0.0]
    if along == [0] or (len(along) == 1 and not any(rpy)):
        roll, pitch, yaw = (rpy[k] + axis[k] * angle for k in range(3))
        return roll, pitch, yaw
    x, y, z = axis
    c, s = math.cos(angle), math.sin(angle)
    u = 1.0 - c
    turn = (
        (c + x * x * u, x * y * u - z * s, x * z * u + y * s),
        (y * x * u + z * s, c + y * y * u, y * z * u - x * s),
        (z * x * u - y * s, z * y * u + x * s, c + z * z * u),
    )
    before = rotation(rpy[0], rpy[1], rpy[2])
    R = [[sum(before[i][k] * turn[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return rpy_of(R)
