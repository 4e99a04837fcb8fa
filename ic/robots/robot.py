"""A robot as in its URDF or MJCF file: links, joints, and the file's other data, each with its place.

Names, numbers and frames are the file's own: SI, turns `rpy` about fixed x, y, z in that order, as in a deck. `None`
stands for what the file leaves out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from ic.robots.xml import Element
from met.diagnostic import Place
from met.frozen import frozen

MOVING = ("revolute", "continuous", "prismatic")
TYPES = (*MOVING, "fixed")


@frozen
class Written:
    """A word of the file with its place."""

    text: str
    place: Place


@frozen
class Numbers:
    """Numbers of an attribute, or of several of one element, with their place; places: of each number,
    where it has its own"""

    values: tuple[float, ...]
    place: Place
    places: tuple[Place, ...] = ()

    @property
    def nothing(self) -> bool:
        return not any(self.values)


@frozen
class Inertial:
    """Mass, and inertia about the centre of mass.

    com, rpy   of the frame of inertia, in the link's
    moments    xx, yy, zz, xy, xz, yz in that frame, kg m^2
    """

    mass: Numbers
    com: Numbers | None
    rpy: Numbers | None
    moments: Numbers
    place: Place

    @property
    def is_turned(self) -> bool:
        return self.rpy is not None and not self.rpy.nothing


@frozen
class Visual:
    """A mesh of a link's looks: its path from the folder of the robot's file, its frame in the link's (m, rad), and the
    factors along its axes that make metres of its numbers."""

    path: str
    place: Place
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@frozen
class RobotLink:
    """A link; visuals: its meshes that exist, whichever reader found them."""

    name: Written
    inertial: Inertial | None
    visuals: tuple[Visual, ...] = ()


@frozen
class Mimic:
    """The joint that another follows, at `multiplier` times its position plus `offset`, m or rad."""

    joint: Written
    multiplier: float = 1.0
    offset: float = 0.0


@frozen
class RobotJoint:
    """A joint; axis in its own frame, as written.

    limits    lower, upper, effort, velocity: those that are written, infinite where none is meant; `limits_at` the
              place of their element
    friction  what acts on it without a motor, by the keys of `passive`: damping, friction, and of a model in MJCF
              stiffness, rest and rotor; `friction_at` their place, None where all are zero or not written
    mimic     the joint that it follows
    followed  the same of a joint that follows none any more; `held` its position where it is fixed instead, `beyond`
              the limits that this is not within, in words
    drive     the same as `friction` together with its actuators, at the controls of the keyframe; empty without one
    start     its position at the start, None where the file has none
    """

    name: Written
    type: Written
    parent: Written
    child: Written
    at: Numbers | None = None
    rpy: Numbers | None = None
    axis: Numbers | None = None
    limits: Mapping[str, Numbers] = field(default_factory=dict)
    limits_at: Place | None = None
    friction: Mapping[str, float] = field(default_factory=dict)
    friction_at: Place | None = None
    mimic: Mimic | None = None
    followed: Mimic | None = None
    held: float = 0.0
    beyond: str = ""
    drive: Mapping[str, float] = field(default_factory=dict)
    start: float | None = None


@frozen
class Robot:
    """A robot.

    root       the link that no joint carries, which is the arm's base
    dropped    elements that were not read, by tag, or of which an attribute was not, by `NAME of TAG`
    unseen     elements that name meshes which are not drawn, by reason
    gravity    m/s^2, in the axes of the base where that is fixed
    base_pose  position, m, and `rpy`, rad, of a base that floats; None of one that is fixed
    keyframe   where the positions at the start are from, in words
    format     of the file: URDF or MJCF
    """

    file: str
    name: str
    links: tuple[RobotLink, ...]
    joints: tuple[RobotJoint, ...]
    root: RobotLink
    dropped: Mapping[str, tuple[Element, ...]]
    unseen: Mapping[str, tuple[Element, ...]] = field(default_factory=dict)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    base_pose: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    keyframe: str = ""
    format: str = "URDF"

    @property
    def carried(self) -> tuple[RobotLink, ...]:
        """The links of the arm, without the root."""
        return tuple(link for link in self.links if link is not self.root)
