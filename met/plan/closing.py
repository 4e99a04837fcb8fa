"""Loops of three joints and a pin in one plane: the two joints that follow, as functions of the one that leads.

Between the two bodies at the joint that leads, the corners besides it are a triangle A, B, V. Its sides p = AV and
r = VB are those of one body each; the third, v = AB, is a known function of the leader's position u. All three are
written in the frames of their own bodies, which are parallel where all joints are at 0. With

    k_A = (v^2 + p^2 - r^2)/2    k_B = (v^2 + r^2 - p^2)/2    k_V = (p^2 + r^2 - v^2)/2    D = +-sqrt(p^2 r^2 - k_V^2)

the angles of the triangle are those of the points (k_A, D), (k_B, D) and (k_V, D); D is twice its area, above 0 where
A, B, V run to the left. Positions, rates and accelerations of the joints at the corners follow in closed form: no
equation is solved, so no loop drifts apart. Where D is 0 the triangle is flat, and its motion is not determined.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Literal

from met.diagnostic import Place
from met.frozen import frozen, keyed
from met.trace import Real, atan2, cos, sign, sin, sqrt, where
from met.vectors import (
    IDENTITY,
    ZERO,
    Vector,
    add,
    cross,
    dot,
    product,
    rotation_rpy,
    scale,
    snap_rotation,
    sub,
    turn_vector,
)

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


FLAT = 1e-13
"""Share of the squares of its sides below which the square of a triangle's area is rounding noise."""


@frozen
class Corner:
    """A joint of a loop, or its pin, where all joints are at 0, in common axes.

    name   of the joint; "" of the pin
    before, after  the corner as the bodies before and after it along the loop have it, m: of a joint the same point
    axis   of the joint, a unit vector
    along  1 where the joint is passed from its parent to its child, else -1
    """

    name: str
    before: Vector
    after: Vector
    kind: Literal["revolute", "prismatic", "fixed"] = "fixed"
    axis: Vector = ZERO
    along: int = 1


@frozen
class Led:
    """A joint that follows by a loop, at one position of the joint that leads.

    q      position, rad, without jumps; whole turns are open
    ratio  rate for each unit of the leader's; not a number where the triangle is flat or cannot be put together
    bend   derivative of `ratio` by the leader's position
    flattening  share of the square of the triangle's area that is lost for each unit of the leader's way
    """

    q: Real
    ratio: Real
    bend: Real
    flattening: Real


def corners_of(loop: Loop, joints: Sequence[Joint], number: Callable[[str], Real]) -> list[Corner]:
    """The corners of a loop along it, from the joint that leads on. number: gives a parameter"""

    def vector(path: str) -> Vector:
        return number(f"{path}.x"), number(f"{path}.y"), number(f"{path}.z")

    rows: list[list[Corner]] = []
    pins: list[Vector] = []
    for way, along, pin in zip(ways(loop, joints), (-1, 1), ("at", "to_at"), strict=True):
        R, p = IDENTITY, ZERO
        rows.append([])
        for joint in way:
            p = add(p, turn_vector(R, vector(f"{joint.name}.at")))
            R = snap_rotation(product(R, rotation_rpy(*vector(f"{joint.name}.rpy"))))
            if joint.kind != "fixed":
                pivot = add(p, turn_vector(R, vector(f"{joint.name}.pivot")))
                axis = turn_vector(R, vector(f"{joint.name}.axis"))
                rows[-1].append(Corner(joint.name, pivot, pivot, joint.kind, axis, along))
        pins.append(add(p, turn_vector(R, vector(f"{loop.name}.{pin}"))))
    corners = [*reversed(rows[0]), *rows[1], Corner("", before=pins[1], after=pins[0])]
    first = [corner.name for corner in corners].index(loop.leader)
    return corners[first:] + corners[:first]


def axis_across(corners: Sequence[Corner]) -> Vector:
    """The axis across a loop's plane: that of the first joint behind the leader, `corners[0]`."""
    return next(corner.axis for corner in corners[1:] if corner.kind == "revolute")


def close(corners: Sequence[Corner], u: Real, left: bool) -> tuple[dict[str, Led], tuple[Real, Real, Real]]:
    """The joints that follow, by name, where the leader of a loop, `corners[0]`, is at u, rad or m; and the sides v, p
    and r of its triangle, m.

    left  whether the corners behind the leader, in their order, turn left about the axis across the plane
    """
    leader, b, v, a = corners
    across, way = axis_across(corners), sub(v.after, a.before)
    way = sub(way, scale(dot(way, across), across))
    first = scale(1.0 / sqrt(dot(way, way)), way)
    second = cross(across, first)

    def flat(point: Vector) -> tuple[Real, Real]:
        return dot(point, first), dot(point, second)

    p, r = flat(sub(v.after, a.before)), flat(sub(v.before, b.after))
    if leader.kind == "revolute":
        turned = leader.along * sign(dot(leader.axis, across))
        start, arm = flat(sub(leader.before, a.after)), flat(sub(b.before, leader.after))
        c, s, begun = cos(u), turned * sin(u), _angle(arm) + turned * u
        arm = (c * arm[0] - s * arm[1], s * arm[0] + c * arm[1])
        side = (start[0] + arm[0], start[1] + arm[1])
        by_start, by_arm = (atan2(_cross(near, side), _dot(near, side)) for near in (start, arm))
        # within 90 deg of the longer of its two parts: no jump
        heading = where(_dot(start, start) > _dot(arm, arm), _angle(start) + by_start, begun + by_arm)
        slope, curve = (-turned * arm[1], turned * arm[0]), (-arm[0], -arm[1])
    else:
        turned = 0.0
        start, slope, curve = flat(sub(b.before, a.after)), flat(scale(float(leader.along), leader.axis)), (0.0, 0.0)
        side = (start[0] + u * slope[0], start[1] + u * slope[1])
        heading = _angle(slope) + atan2(_cross(slope, start), _dot(slope, start) + u)
    vv, pp, rr = _dot(side, side), _dot(p, p), _dot(r, r)
    k_a, k_b, k_v = 0.5 * (vv + pp - rr), 0.5 * (vv + rr - pp), 0.5 * (pp + rr - vv)
    square = pp * rr - k_v * k_v
    closes = square > FLAT * pp * rr
    size, by_side = sqrt(where(closes, square, math.nan)), 1.0 / where(closes, vv, math.nan)
    area = size if left else -size
    m, dm = _dot(side, slope), _dot(slope, slope) + _dot(side, curve)
    angle_v = m / area
    angle_v2 = (dm - angle_v * angle_v * k_v) / area
    angle_a, angle_b = -k_b * by_side * angle_v, -k_a * by_side * angle_v
    angle_a2 = -by_side * (m * (1.0 - 2.0 * k_b * by_side) * angle_v + k_b * angle_v2)
    angle_b2 = -by_side * (m * (1.0 - 2.0 * k_a * by_side) * angle_v + k_a * angle_v2)
    swing = _cross(side, slope) * by_side
    swing2 = (_cross(side, curve) - 2.0 * m * swing) * by_side
    values = (
        (b, heading - turned * u - atan2(area, k_b) + math.pi - _angle(r), swing - turned - angle_b, swing2 - angle_b2),
        (v, _angle(r) - _angle(p) - atan2(area, k_v), -angle_v, -angle_v2),
        (a, _angle(p) - heading - atan2(area, k_a), -swing - angle_a, -swing2 - angle_a2),
    )
    followers = {}
    for corner, *numbers in values:
        direction = corner.along * sign(dot(corner.axis, across))
        position, ratio, bend = (direction * number for number in numbers)
        followers[corner.name] = Led(position, ratio, bend, flattening=-2.0 * k_v * m / square)
    return followers, (sqrt(vv), sqrt(pp), sqrt(rr))


def _angle(a: tuple[Real, Real]) -> Real:
    """The angle of a point, rad."""
    return atan2(a[1], a[0])


def _dot(a: tuple[Real, Real], b: tuple[Real, Real]) -> Real:
    return a[0] * b[0] + a[1] * b[1]


def _cross(a: tuple[Real, Real], b: tuple[Real, Real]) -> Real:
    return a[0] * b[1] - a[1] * b[0]
