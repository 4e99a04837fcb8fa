"""A robot as the entries of a deck's arm, each with its place in the URDF file.

    link upper { mass = 2 kg; com = [0, 0, 0.1] m; inertia = [...] kg*m^2; }
    joint elbow revolute { parent = upper; child = lower; at = [...] m; rpy = [...] rad; axis = z; }

A link without an inertia is `mass = 0 kg`. A continuous joint is a revolute one. Where the frame of inertia is turned,
the moments are written in the link's axes. What is zero by itself is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from ic.grammar.syntax import (
    Call,
    Entry,
    Expression,
    Group,
    List,
    Name,
    Number,
    Setting,
    String,
    Unary,
    Unit,
    WithUnit,
    Word,
)  # fmt: skip
from ic.robots.names import DeckNames, deck_names
from ic.robots.robot import MOVING, Inertial, Numbers, Robot, RobotJoint, RobotLink, Visual, Written
from met.diagnostic import Place
from met.frozen import frozen
from met.plan import BASE
from met.plan.channel import ratio_unit

AXES = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
UNITS = {
    "kg": (("kg", 1),),
    "m": (("m", 1),),
    "rad": (("rad", 1),),
    "kg*m^2": (("kg", 1), ("m", 2)),
    "m/rad": (("m", 1), ("rad", -1)),
    "rad/m": (("rad", 1), ("m", -1)),
    "m/s": (("m", 1), ("s", -1)),
    "rad/s": (("rad", 1), ("s", -1)),
    "N": (("N", 1),),
    "N*m": (("N", 1), ("m", 1)),
}
LIMITS = {"lower": "q_min", "upper": "q_max", "velocity": "qd_max", "effort": "tau_max"}
"""Limits of a URDF file's joint, with their names in a deck."""
LEFT_OUT = "URDF's default: the file leaves it out here"
ZERO = "written here as 0, or left out"
TURNED = "written here, and turned into the link's axes"
NOTES = (LEFT_OUT, ZERO, TURNED)
"""Notes on places, each a sentence of its own."""

NOISE = 1e-15  # of sines and cosines of right angles, whose size is 1: cos(pi/2) is 6e-17 in doubles


@frozen
class RobotEntry:
    """A link or joint of the robot as an entry."""

    source: RobotLink | RobotJoint
    entry: Group

    @property
    def weighs(self) -> bool:
        """True for a link whose inertia the file has."""
        return isinstance(self.source, RobotLink) and self.source.inertial is not None


@frozen
class ArmEntries:
    """A robot's arm: its entries, links and then joints, in the file's order, with the names in decks.

    base     the link `base`, as a base that moves has it; None where the file's root has neither inertia nor meshes
    notes    on places whose text is not the number that entries have from there: how this came about
    no_body  why the root's inertia is left out, where no body has it; else empty
    """

    robot: Robot
    names: DeckNames
    base: RobotEntry | None
    links: tuple[RobotEntry, ...]
    joints: tuple[RobotEntry, ...]
    notes: Mapping[Place, str]
    no_body: str = ""

    @property
    def entries(self) -> tuple[Entry, ...]:
        return tuple(part.entry for part in (*self.links, *self.joints))


def arm_entries(robot: Robot) -> ArmEntries:
    """The entries of a deck's arm that a robot's file gives: links, joints and base, with notes on their origin."""
    names = deck_names(robot)
    links = tuple(RobotEntry(link, _link(link, names.links[link.name.text])) for link in robot.carried)
    kinds = {joint.name.text: _kind(joint) for joint in robot.joints}
    joints = tuple(RobotEntry(joint, _joint(joint, names, kinds)) for joint in robot.joints)
    root = robot.root
    base = RobotEntry(root, _link(root, BASE)) if root.inertial is not None or root.visuals else None
    return ArmEntries(robot, names, base, links, joints, dict(_notes(robot)))


def _notes(robot: Robot) -> Iterator[tuple[Place, str]]:
    """The places of a robot's file whose text is not the number that the arm's entries have from there, each with the
    reason."""
    for link in robot.links:
        inertial = link.inertial
        if inertial is None:
            yield link.name.place, LEFT_OUT
        elif inertial.is_turned:
            yield inertial.moments.place, TURNED
        else:
            yield inertial.moments.place, LEFT_OUT if any(inertial.moments.values[3:]) else ZERO
    for joint in robot.joints:
        if joint.axis is None:
            yield joint.name.place, LEFT_OUT
        if joint.limits_at is not None:
            yield joint.limits_at, LEFT_OUT


def _link(link: RobotLink, name: str) -> Group:
    """The entry of a link of a robot's file: mass (kg), centre of mass (m), inertia (kg m^2)."""
    inertial = link.inertial
    if inertial is None:
        settings = [_setting("mass", _number(0.0, "kg", link.name.place), link.name.place)]
    else:
        settings = [_setting("mass", _number(inertial.mass.values[0], "kg", inertial.mass.place), inertial.mass.place)]
        if inertial.com is not None and not inertial.com.nothing:
            settings.append(_vector("com", inertial.com, "m"))
        if inertial.mass.values[0] != 0.0 or not inertial.moments.nothing:
            settings.append(_vector("inertia", moments(inertial), "kg*m^2"))
    if link.visuals:
        files = tuple(map(_mesh, link.visuals))
        mesh = files[0] if len(files) == 1 else List(files, link.visuals[0].place)
        settings.append(_setting("mesh", mesh, link.visuals[0].place))
    return _group("link", name, None, settings, link.name.place)


def _mesh(visual: Visual) -> Expression:
    """The file of a mesh, within a call where it is not at the link's frame."""
    place, file = visual.place, String(visual.path, visual.place)
    placing = (
        ("at", visual.at, (0.0, 0.0, 0.0), "m"),
        ("rpy", visual.rpy, (0.0, 0.0, 0.0), "rad"),
        ("scale", visual.scale, (1.0, 1.0, 1.0), ""),
    )
    named: list[tuple[Word, Expression]] = []
    for key, values, default, unit in placing:
        if values != default:
            numbers = List(tuple(_signed(value, "", place) for value in values), place)
            named.append((Word(key, place), WithUnit(numbers, _unit(unit, place), place) if unit else numbers))
    return Call(_name("placed", place), (file,), tuple(named), None, place) if named else file


def moments(inertial: Inertial) -> Numbers:
    """The moments of inertia xx, yy, zz in the link's axes, kg m^2, and xy, xz, yz where one of them is not zero."""
    numbers = inertial.moments
    if inertial.rpy is not None and inertial.is_turned:
        numbers = Numbers(_turned(numbers.values, inertial.rpy.values), numbers.place)  # each of them made of all
    return numbers if any(numbers.values[3:]) else Numbers(numbers.values[:3], numbers.place, numbers.places[:3])


def _turned(values: tuple[float, ...], rpy: tuple[float, ...]) -> tuple[float, ...]:
    """R I R' with R = Rz(yaw) Ry(pitch) Rx(roll): the same inertia in axes rotated back."""
    xx, yy, zz, xy, xz, yz = values
    inertia = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    R = rotation(*rpy)
    half = [[sum(R[i][k] * inertia[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    product = [[sum(half[i][k] * R[j][k] for k in range(3)) for j in range(3)] for i in range(3)]
    off = [(product[i][j] + product[j][i]) / 2.0 + 0.0 for i, j in ((0, 1), (0, 2), (1, 2))]
    return (product[0][0], product[1][1], product[2][2], *off)


def rotation(roll: float, pitch: float, yaw: float) -> tuple[tuple[float, float, float], ...]:
    """The rotation matrix Rz(yaw) Ry(pitch) Rx(roll), rad."""
    (cr, sr), (cp, sp), (cy, sy) = (_turn(angle) for angle in (roll, pitch, yaw))
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def rpy_of(R: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Turns about fixed x, y, z that make a rotation; where the pitch is a right angle, without a yaw where rounding
    leaves none."""
    across = math.hypot(R[0][0], R[1][0])
    yaw = math.atan2(R[1][0], R[0][0]) if across > NOISE else 0.0
    c, s = _turn(yaw)
    roll = math.atan2(s * R[0][2] - c * R[1][2], c * R[1][1] - s * R[0][1])
    return roll + 0.0, math.atan2(-R[2][0], across) + 0.0, yaw + 0.0  # -0 is 0


def _turn(angle: float) -> tuple[float, float]:
    """Cosine and sine of an angle, with rounding noise at right angles set to 0."""
    c, s = math.cos(angle), math.sin(angle)
    return (0.0 if abs(c) < NOISE else c), (0.0 if abs(s) < NOISE else s)


def _kind(joint: RobotJoint) -> str:
    """The kind of the joint in a deck."""
    return "revolute" if joint.type.text == "continuous" else joint.type.text


def _joint(joint: RobotJoint, names: DeckNames, kinds: Mapping[str, str]) -> Group:
    """The entry of a joint: its ends, frame, axis, limits, and what it follows."""
    kind = _kind(joint)
    settings = [_end("parent", joint.parent, names), _end("child", joint.child, names)]
    if joint.at is not None and not joint.at.nothing:
        settings.append(_vector("at", joint.at, "m"))
    if joint.rpy is not None and not joint.rpy.nothing:
        settings.append(_vector("rpy", joint.rpy, "rad"))
    if kind in ("revolute", "prismatic"):
        axis = joint.axis or Numbers((1.0, 0.0, 0.0), joint.name.place)  # URDF's default
        settings.append(_setting("axis", _axis(axis), axis.place))
    way, effort = ("m", "N") if kind == "prismatic" else ("rad", "N*m")
    units = {"lower": way, "upper": way, "velocity": f"{way}/s", "effort": effort}
    for name, limit in limits(joint).items():
        settings.append(_setting(LIMITS[name], _signed(limit.values[0], units[name], limit.place), limit.place))
    if joint.mimic is not None:
        leader, multiplier, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
        settings.append(_setting("follows", _name(names.joints[leader.text], leader.place), leader.place))
        if multiplier != 1.0:
            unit = ratio_unit(kind, kinds[leader.text])
            ratio = _signed(multiplier, unit if unit in UNITS else "", leader.place)
            settings.append(_setting("ratio", ratio, leader.place))
        if offset:
            settings.append(_setting("offset", _signed(offset, way, leader.place), leader.place))
    return _group("joint", names.joints[joint.name.text], Word(kind, joint.type.place), settings, joint.name.place)


def limits(joint: RobotJoint) -> dict[str, Numbers]:
    """The limits of the joint: none of position where it is continuous, or where both ends are 0 or left out; else an
    end that is left out is 0. Infinite ones are none, and so are an effort and a velocity of 0."""
    if joint.type.text not in MOVING or joint.limits_at is None:
        return {}
    left_out = Numbers((0.0,), joint.limits_at)
    ends = {name: joint.limits.get(name, left_out) for name in LIMITS}
    ranges = joint.type.text != "continuous" and not (ends["lower"].nothing and ends["upper"].nothing)
    return {
        name: limit
        for name, limit in ends.items()
        if math.isfinite(limit.values[0]) and (ranges if name in ("lower", "upper") else not limit.nothing)
    }


def _end(key: str, link: Written, names: DeckNames) -> Setting:
    return _setting(key, _name(names.links[link.text], link.place), link.place)


def _axis(axis: Numbers) -> Expression:
    """A joint's axis as a deck writes it: `z`, `-x`, or three numbers."""
    x, y, z = axis.values
    if (x, y, z) in AXES:
        return _name(AXES[x, y, z], axis.place)
    if (-x + 0.0, -y + 0.0, -z + 0.0) in AXES:
        return Unary("-", _name(AXES[-x + 0.0, -y + 0.0, -z + 0.0], axis.place), axis.place)
    return List(tuple(_number(value, "", axis.place) for value in axis.values), axis.place)


# Nodes of the syntax tree


def _group(kind: str, name: str, detail: Word | None, settings: list[Setting], place: Place) -> Group:
    words = (Word(kind, place), Word(name, place), *((detail,) if detail is not None else ()))
    return Group(words, None, None, tuple(settings), place)


def _setting(key: str, value: Expression, place: Place) -> Setting:
    return Setting((), (Word(key, place),), "=", value, place)


def _vector(key: str, numbers: Numbers, unit: str) -> Setting:
    """The entry of three numbers with a unit, each with its place in the file."""
    place = numbers.place
    places = numbers.places or (place,) * len(numbers.values)
    items = tuple(_number(value, "", spot) for value, spot in zip(numbers.values, places, strict=True))
    return _setting(key, WithUnit(List(items, place), _unit(unit, place), place), place)


def _number(value: float, unit: str, place: Place) -> Number:
    """A number with a unit of `UNITS`, or "" for none; a negative one with its sign in the text."""
    return Number(value, _unit(unit, place) if unit else None, place, spelled(value))


def _signed(value: float, unit: str, place: Place) -> Expression:
    """A number as `_number` makes it, the sign of a negative one before it."""
    return _number(value, unit, place) if value >= 0.0 else Unary("-", _number(-value, unit, place), place)


def _unit(text: str, place: Place) -> Unit:
    return Unit(tuple((Word(name, place), power) for name, power in UNITS[text]), place, text)


def _name(text: str, place: Place) -> Name:
    return Name((Word(text, place),), place)


def spelled(value: float) -> str:
    """The shortest text that a deck reads as this exact number."""
    text = repr(value)
    return text.removesuffix(".0")
