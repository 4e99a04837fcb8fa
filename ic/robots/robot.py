"""A robot as in its URDF file: links, joints, and the file's other data, each with its place.

Names, numbers and frames are the file's own: SI, turns `rpy` about fixed x, y, z in that order, as in a deck. `None`
stands for what the file leaves out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

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
    """Numbers of an attribute, or of several of one element, with their place; each: its own place"""

    values: tuple[float, ...]
    place: Place
    each: tuple[Place, ...] = ()

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


@frozen
class Link:
    name: Written
    inertial: Inertial | None


@frozen
class Joint:
    """A joint; axis in its own frame, as written.

    limits    lower, upper, effort, velocity: those that are written and are numbers; `limits_at` their place
    friction  damping and friction, not negative; `friction_at` their place, None where both are zero or not written
    mimic     the joint that it follows; `law` its multiplier and offset as written
    followed  the same of a joint that follows none any more
    """

    name: Written
    type: Written
    parent: Written
    child: Written
    at: Numbers | None = None
    rpy: Numbers | None = None
    axis: Numbers | None = None
    limits: Mapping[str, float] = field(default_factory=dict)
    limits_at: Place | None = None
    friction: Mapping[str, float] = field(default_factory=dict)
    friction_at: Place | None = None
    mimic: Written | None = None
    law: str = ""
    followed: Written | None = None


@frozen
class Robot:
    """A robot. root: the link that no joint carries, which is the arm's base; dropped: names of what was not read"""

    file: str
    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    root: Link
    dropped: Mapping[str, tuple[Place, ...]]

    @property
    def carried(self) -> tuple[Link, ...]:
        """The links of the arm, without the root."""
        return tuple(link for link in self.links if link is not self.root)
