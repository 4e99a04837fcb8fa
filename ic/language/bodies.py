"""The blocks of a deck about bodies: links, joints between them, and payloads."""

from __future__ import annotations

from ic.language.declaration import BlockDeclaration, Entry
from met.parameter import ZEROS, Parameter

MASS = Parameter(name="mass", unit="kg", at_least=0.0, doc="mass of the {}")
COM = Parameter(name="com", unit="m", shape="vector", doc="centre of mass, in the {}'s frame")
INERTIA = Parameter(
    name="inertia", unit="kg*m^2", shape="list", doc="inertia about the centre of mass, along the {}'s axes"
)
LUMPED = Parameter(
    name="lumped",
    shape="word",
    words=("on", "off"),
    default="off",
    doc="whether the numbers of this link are an identified set (base parameters), not those of a body",
)

LINK = BlockDeclaration(
    name="link",
    written="link NAME { ... }",
    within="arm",
    head="links",
    doc="A rigid body of the arm, or a frame without mass. A link called `base` is the body of a base that moves.",
    entries=(
        Entry(name="mass", written="mass = 3.5 kg;", parameter=MASS, varies="number", path="links.LINK.mass",
              doc="mass of the link; `0 kg` makes it a frame without inertia"),
        Entry(name="shape", written="shape = rod(length = 1 m, along = x);", default="none", path="links.LINK.shape",
              doc="a uniform solid with the mass of the link; `com` and `inertia` follow from it unless they are "
                  "written (`met doc shapes`)"),
        Entry(name="com", written="com = [0.2, 0, 0] m;", parameter=COM, varies="number", path="links.LINK.com",
              default="the centre of the shape; without a shape, the origin",
              doc="centre of mass, in the link's frame"),
        Entry(name="inertia", written="inertia = [0.1, 0.2, 0.2] kg*m^2;", parameter=INERTIA, varies="number",
              path="links.LINK.inertia", default="that of the shape; without a shape, needed",
              doc="inertia about the centre of mass, along the link's axes: `[xx, yy, zz]` or "
                  "`[xx, yy, zz, xy, xz, yz]`"),
        Entry(name="mesh", written='mesh = "upper.stl";', default="none",
              doc="a file with the link's surface, for pictures: no number follows from it; `placed(\"upper.stl\", "
                  "at = [0, 0, 0.1] m, rpy = [0, 0, 90] deg, scale = [0.001, 0.001, 0.001])` puts it elsewhere, and "
                  "several stand in a list"),
        Entry(name="lumped", written="lumped = on;", parameter=LUMPED, path="links.LINK.lumped", default="`off`",
              doc="`on`: the numbers of this link are an identified set (base parameters), not those of a body; each "
                  "run checks the mass matrix of the arm instead"),
    ),
)  # fmt: skip

EI = Parameter(name="EI", unit="N*m^2", above=0.0, doc="bending stiffness of the boom's cross-section")
GJ = Parameter(name="GJ", unit="N*m^2", above=0.0, doc="torsional stiffness of the boom's cross-section")
DAMPING_RATIO = Parameter(
    name="damping_ratio", unit="1", at_least=0.0, doc="damping ratio of the first mode of the bare boom, clamped"
)
NODES = Parameter(name="nodes", unit="1", at_least=2.0, at_most=16.0, doc="places where the boom bends")

BOOM = BlockDeclaration(
    name="boom",
    written="link NAME boom { ... }",
    within="arm",
    head="links",
    doc="A link that bends and twists: a uniform beam along its shape, a rod, a box or a cylinder.",
    entries=(
        Entry(name="mass", written="mass = 84 kg;", parameter=MASS, varies="number", path="links.LINK.mass",
              doc="mass of the boom, above 0, along all of it"),
        Entry(name="shape", written="shape = cylinder(radius = 0.1 m, length = 7 m, along = x);",
              path="links.LINK.shape",
              doc="a cylinder, a box or a rod: how long the boom is, along which axis, and its centre and inertia"),
        Entry(name="EI", written="EI = 2.8e6 N*m^2;", parameter=EI, varies="number", path="links.LINK.EI",
              doc="bending stiffness; a list of two, `[3e6, 1e6] N*m^2`, about the two axes across the boom, in the "
                  "order x, y, z"),
        Entry(name="GJ", written="GJ = 1.2e6 N*m^2;", parameter=GJ, varies="number", path="links.LINK.GJ",
              default="it does not twist", doc="torsional stiffness"),
        Entry(name="damping_ratio", written="damping_ratio = 0.5 %;", parameter=DAMPING_RATIO, varies="number",
              path="links.LINK.damping_ratio",
              doc="damping ratio of the first mode of the bare boom, clamped at its root; of a mode with another "
                  "frequency it is in proportion to the frequency"),
        Entry(name="nodes", written="nodes = 4;", parameter=NODES, path="links.LINK.nodes", default="4",
              doc="places where the boom bends, an even number: 4 give its first two modes, 6 or 8 the third"),
    ),
)  # fmt: skip

AT = Parameter(
    name="at", unit="m", shape="vector", default=ZEROS, doc="origin of the joint's frame, in the parent's frame"
)
RPY = Parameter(
    name="rpy",
    unit="rad",
    shape="vector",
    default=ZEROS,
    doc="rotation of the joint's frame about the parent's fixed x, then y, then z axis",
)
AXIS = Parameter(name="axis", unit="1", shape="vector", doc="axis of motion, in the joint's frame")

Q_MIN = Parameter(name="q_min", unit="joint", less_than="q_max", doc="lower end of the joint's range")
Q_MAX = Parameter(name="q_max", unit="joint", doc="upper end of the joint's range")
QD_MAX = Parameter(name="qd_max", unit="joint/s", above=0.0, doc="largest rate of the joint in either direction")
TAU_MAX = Parameter(
    name="tau_max", unit="effort", above=0.0, doc="largest torque of the servo on the joint in either direction"
)
JOINT_LIMITS = (Q_MIN, Q_MAX, QD_MAX, TAU_MAX)
"""Limits that a joint should stay within: every run monitors them, and none of them affects the motion."""

RATIO = Parameter(
    name="ratio",
    unit="1",
    default=1.0,
    at_least=-1e100,
    at_most=1e100,  # of its square times an inertia, a number is left
    doc="position of the joint for each unit of the joint that it follows",
)
OFFSET = Parameter(
    name="offset", unit="joint", default=0.0, doc="position of the joint where all that it follows are at 0"
)

JOINT_KINDS = ("revolute", "prismatic", "fixed")

JOINT = BlockDeclaration(
    name="joint",
    written="joint NAME revolute { ... }",
    within="arm",
    doc="Connects a link to another link or to the base: `revolute`, `prismatic` or `fixed`.",
    entries=(
        Entry(name="parent", written="parent = base;", doc="the link that carries the joint, or `base`"),
        Entry(name="child", written="child = LINK;", doc="the link that the joint holds on the parent"),
        Entry(name="at", written="at = [0, 0, 0.3] m;", parameter=AT, varies="number", path="JOINT.at",
              default="`[0, 0, 0] m`", doc="origin of the joint's frame, in the parent's frame"),
        Entry(name="rpy", written="rpy = [0, 0, 90] deg;", parameter=RPY, varies="number", path="JOINT.rpy",
              default="`[0, 0, 0] rad`",
              doc="rotation of the joint's frame: about the parent's fixed x, then y, then z axis"),
        Entry(name="axis", written="axis = z;", parameter=AXIS, varies="number", path="JOINT.axis",
              default="needed, unless the joint is `fixed`",
              doc="axis of motion in the joint's frame: `x`, `y`, `z`, `-x`, `-y`, `-z`, or a direction such as "
                  "`[0, 3, 4]`"),
        Entry(name="dh", written="dh = classic(a = 0.4 m, alpha = 90 deg);", default="none", path="JOINT.dh",
              doc="Denavit-Hartenberg numbers, in place of `at`, `rpy` and `axis` (`met doc dh`)"),
        Entry(name="q_min", written="q_min = -170 deg;", parameter=Q_MIN, varies="number", path="JOINT.q_min",
              default="none",
              doc="lower end of the joint's range, written together with `q_max`; a run warns of a position below it"),
        Entry(name="q_max", written="q_max = 170 deg;", parameter=Q_MAX, varies="number", path="JOINT.q_max",
              default="none",
              doc="upper end of the joint's range; a run warns of a position above it, but only a `joint_stop` of "
                  "the environment stops the joint"),
        Entry(name="qd_max", written="qd_max = 2.6 rad/s;", parameter=QD_MAX, varies="number", path="JOINT.qd_max",
              default="none", doc="largest rate of the joint in either direction; a run warns of a higher one"),
        Entry(name="tau_max", written="tau_max = 87 N*m;", parameter=TAU_MAX, varies="number", path="JOINT.tau_max",
              default="none",
              doc="largest torque of the servo on the joint in either direction; a run warns of a higher one"),
        Entry(name="follows", written="follows = JOINT;", default="none",
              doc="the joint that this one follows, as by gears, or several, `[JOINT, ...]`: its position is their "
                  "positions times `ratio`, plus `offset`; all move as one, and what acts on one acts on all"),
        Entry(name="ratio", written="ratio = -1;", parameter=RATIO, varies="number", path="JOINT.ratio", default="1",
              doc="position of the joint for each unit of the joint that it follows; of several a list, one for each, "
                  "and 1 for each by default"),
        Entry(name="offset", written="offset = 5 mm;", parameter=OFFSET, varies="number", path="JOINT.offset",
              default="0", doc="position of the joint where all that it follows are at 0"),
    ),
)  # fmt: skip

LEADER = Parameter(name="leader", shape="word", doc="the joint of the loop that leads the others")
PIN_AT = Parameter(name="at", unit="m", shape="vector", default=ZEROS, doc="the pin in the frame of `link`")
TO_AT = Parameter(name="to_at", unit="m", shape="vector", default=ZEROS, doc="the pin in the frame of `to`")
BRANCH = Parameter(
    name="branch",
    shape="word",
    words=("left", "right"),
    doc="which of the two ways to close the loop",
)

LOOP = BlockDeclaration(
    name="loop",
    written="loop NAME { ... }",
    within="arm",
    doc="A pin that holds a point of one link on a point of another, and closes three joints that move in one plane: a "
    "ram, or a linkage of four bars. One of them leads, the others follow it.",
    entries=(
        Entry(name="leader", written="leader = JOINT;", parameter=LEADER,
              doc="the joint that leads: the one that slides, if one does"),
        Entry(name="link", written="link = LINK;", doc="a link that the pin holds"),
        Entry(name="at", written="at = [0.8, 0, 0] m;", parameter=PIN_AT, varies="number", path="LOOP.at",
              default="`[0, 0, 0] m`", doc="where the pin is, in the frame of `link`"),
        Entry(name="to", written="to = LINK;", doc="the other link that it holds, or `base`"),
        Entry(name="to_at", written="to_at = [1.2, 0, -0.1] m;", parameter=TO_AT, varies="number", path="LOOP.to_at",
              default="`[0, 0, 0] m`", doc="where the pin is, in the frame of `to`"),
        Entry(name="branch", written="branch = left;", parameter=BRANCH, path="LOOP.branch",
              doc="which of the two ways to close it: round the loop from the leader, in the direction from the pin "
                  "through `link`, the other corners turn `left` or `right`, seen with the axis of the first of them "
                  "towards you"),
    ),
)  # fmt: skip

PAYLOAD_AT = Parameter(
    name="at", unit="m", shape="vector", default=ZEROS, doc="origin of the payload's frame, in the link's frame"
)
PAYLOAD_RPY = Parameter(
    name="rpy",
    unit="rad",
    shape="vector",
    default=ZEROS,
    doc="rotation of the payload's frame about the link's fixed x, then y, then z axis",
)
GRAPPLE = Parameter(name="grapple", unit="s", at_least=0.0, doc="time at which the link grapples the payload")
RELEASE = Parameter(name="release", unit="s", at_least=0.0, doc="time at which the link releases the payload")
POSITION = Parameter(
    name="position", unit="m", shape="vector", doc="origin of the payload's frame at the start, in world axes"
)
ATTITUDE = Parameter(
    name="attitude",
    unit="rad",
    shape="vector",
    default=ZEROS,
    doc="rotation of the payload's frame at the start, about the world's fixed x, then y, then z axis",
)
VELOCITY = Parameter(
    name="velocity",
    unit="m/s",
    shape="vector",
    default=ZEROS,
    doc="velocity of the payload frame's origin at the start, in world axes",
)
RATE = Parameter(
    name="rate",
    unit="rad/s",
    shape="vector",
    default=ZEROS,
    doc="angular velocity of the payload at the start, in world axes",
)


def _as_of_a_link(entry: Entry) -> Entry:
    """The entry of a payload that is like this one of a link."""
    return Entry(
        name=entry.name,
        written=entry.written,
        doc=entry.doc.replace("; `0 kg` makes it a frame without inertia", "").replace("link", "payload"),
        default=entry.default,
        parameter=entry.parameter,
        varies=entry.varies,
        path=entry.path.replace("links.LINK", "payloads.PAYLOAD"),
    )


def _of_flight(wanted: Parameter, doc: str, default: str, written: str) -> Entry:
    """An entry of a payload for its motion before it is grappled."""
    return Entry(
        name=wanted.name,
        written=written,
        parameter=wanted,
        varies="number",
        path=f"payloads.PAYLOAD.{wanted.name}",
        default=default,
        doc=doc,
    )


PAYLOAD = BlockDeclaration(
    name="payload",
    written="payload NAME { ... }",
    within="run",
    head="payloads",
    doc="A body that a link carries, grapples or releases.",
    entries=(
        *(_as_of_a_link(LINK[name]) for name in ("mass", "com", "inertia", "shape")),
        Entry(name="on", written="on = LINK;", doc="the link that carries or grapples the payload; it may be `base`"),
        Entry(name="at", written="at = [0.1, 0, 0] m;", parameter=PAYLOAD_AT, varies="number", default="0",
              path="payloads.PAYLOAD.at",
              doc="origin of the payload's frame, in the link's frame; for a payload that is grappled, the place where "
                  "the grapple expects it"),
        Entry(name="rpy", written="rpy = [0, 0, 90] deg;", parameter=PAYLOAD_RPY, varies="number", default="0",
              path="payloads.PAYLOAD.rpy",
              doc="rotation of the payload's frame about the link's fixed x, then y, then z axis, for a payload that "
                  "is held from the start"),
        Entry(name="grapple", written="grapple = 2 s;", parameter=GRAPPLE, varies="number",
              path="payloads.PAYLOAD.grapple", default="none: held from the start",
              doc="time at which the link grapples the payload"),
        Entry(name="release", written="release = 5 s;", parameter=RELEASE, varies="number",
              path="payloads.PAYLOAD.release",
              default="none: never released", doc="time at which the link releases the payload"),
        _of_flight(POSITION, "origin of the payload's frame at the start, in world axes, for a payload that is "
                             "grappled",
                   "needed with `grapple`",
                   "position = [1, 0, 0] m;"),
        _of_flight(ATTITUDE, "rotation of the payload's frame at the start, about the world's fixed x, then y, then "
                             "z axis, for a payload that is grappled", "0",
                   "attitude = [0, 0, 90] deg;"),
        _of_flight(VELOCITY, "velocity of the payload frame's origin at the start, in world axes, for a payload that "
                             "is grappled", "0",
                   "velocity = [0, 1, 0] cm/s;"),
        _of_flight(RATE, "angular velocity of the payload at the start, in world axes, for a payload that is grappled",
                   "0", "rate = [0, 0, 1] deg/s;"),
    ),
)  # fmt: skip

ARM = BlockDeclaration(
    name="arm",
    written="arm NAME { ... }",
    doc="A tree of links, and the joints that connect them.",
    entries=(
        Entry(
            name="link",
            form="named",
            written="link NAME { ... }",
            doc="a rigid body, or a frame without mass (`met doc link`); as `link NAME boom`, one that bends (`met doc "
            "boom`)",
        ),
        Entry(
            name="joint",
            form="named",
            written="joint NAME revolute { ... }",
            doc="a connection of two links: `revolute`, `prismatic` or `fixed` (`met doc joint`)",
        ),
        Entry(
            name="loop",
            form="named",
            written="loop NAME { ... }",
            doc="a pin that closes three joints to a ram or a linkage of four bars (`met doc loop`)",
        ),
    ),
)
