"""The blocks of a deck about bodies: links, joints between them, and payloads."""

from __future__ import annotations

from ic.language.declaration import BlockDeclaration, Entry
from met.parameter import ZEROS, Parameter

MASS = Parameter(name="mass", unit="kg", at_least=0.0, doc="mass of the {}")
COM = Parameter(name="com", unit="m", shape="vector", doc="centre of mass, {} frame")
INERTIA = Parameter(name="inertia", unit="kg*m^2", shape="list", doc="inertia about the centre of mass, {} axes")

LINK = BlockDeclaration(
    name="link",
    written="link NAME { ... }",
    within="arm",
    head="links",
    doc="A rigid body, or a frame without mass; the link `base` is the body of a base that moves.",
    entries=(
        Entry(name="mass", written="mass = 3.5 kg;", parameter=MASS, varies="number", path="links.LINK.mass",
              doc="mass; `0 kg` makes the link a frame, without inertia"),
        Entry(name="shape", written="shape = rod(length = 1 m, along = x);", default="none", path="links.LINK.shape",
              doc="a uniform solid of that mass: `met doc shapes`"),
        Entry(name="com", written="com = [0.2, 0, 0] m;", parameter=COM, varies="number", path="links.LINK.com",
              default="middle of the shape; the frame's origin without one", doc="centre of mass, link frame"),
        Entry(name="inertia", written="inertia = [0.1, 0.2, 0.2] kg*m^2;", parameter=INERTIA, varies="number",
              path="links.LINK.inertia", default="that of the shape, else needed",
              doc="`[xx, yy, zz]` or `[xx, yy, zz, xy, xz, yz]` about the centre of mass, link axes"),
    ),
)  # fmt: skip

AT = Parameter(name="at", unit="m", shape="vector", default=ZEROS, doc="origin of the joint frame, parent link's frame")
RPY = Parameter(name="rpy", unit="rad", shape="vector", default=ZEROS, doc="turn of the joint frame, fixed x-y-z")
AXIS = Parameter(name="axis", unit="1", shape="vector", doc="axis of motion, joint frame")

Q_MIN = Parameter(name="q_min", unit="joint", less_than="q_max", doc="lower end of the joint's range")
Q_MAX = Parameter(name="q_max", unit="joint", doc="upper end of the joint's range")
QD_MAX = Parameter(name="qd_max", unit="joint/s", above=0.0, doc="largest rate of the joint, either way")
TAU_MAX = Parameter(name="tau_max", unit="effort", above=0.0, doc="largest torque on the joint, either way")
JOINT_LIMITS = (Q_MIN, Q_MAX, QD_MAX, TAU_MAX)
"""What a joint should stay within: watched in every run, and nothing that keeps it there."""

JOINT_KINDS = ("revolute", "prismatic", "fixed")

JOINT = BlockDeclaration(
    name="joint",
    written="joint NAME revolute { ... }",
    within="arm",
    doc="Holds one link on another or on the base: `revolute`, `prismatic` or `fixed`.",
    entries=(
        Entry(name="parent", written="parent = base;", doc="`base` or a link"),
        Entry(name="child", written="child = LINK;", doc="a link"),
        Entry(name="at", written="at = [0, 0, 0.3] m;", parameter=AT, varies="number", path="JOINT.at",
              default="`[0, 0, 0] m`", doc="origin of the joint's frame, in the parent's frame"),
        Entry(name="rpy", written="rpy = [0, 0, 90] deg;", parameter=RPY, varies="number", path="JOINT.rpy",
              default="`[0, 0, 0] rad`", doc="turn of the joint's frame: about the parent's x, then y, then z"),
        Entry(name="axis", written="axis = z;", parameter=AXIS, varies="number", path="JOINT.axis",
              default="needed unless fixed", doc="x, y, z, -x, ..., or a direction `[0, 3, 4]`, in the joint's frame"),
        Entry(name="dh", written="dh = classic(a = 0.4 m, alpha = 90 deg);", default="none", path="JOINT.dh",
              doc="Denavit-Hartenberg numbers, in place of the three above: `met doc dh`"),
        Entry(name="q_min", written="q_min = -170 deg;", parameter=Q_MIN, varies="number", path="JOINT.q_min",
              default="none", doc="the lower end of its range, which a run is warned to pass; with `q_max`"),
        Entry(name="q_max", written="q_max = 170 deg;", parameter=Q_MAX, varies="number", path="JOINT.q_max",
              default="none", doc="the upper end; what stops it there is a `joint_stop` of the environment"),
        Entry(name="qd_max", written="qd_max = 2.6 rad/s;", parameter=QD_MAX, varies="number", path="JOINT.qd_max",
              default="none", doc="the largest rate, either way, likewise"),
        Entry(name="tau_max", written="tau_max = 87 N*m;", parameter=TAU_MAX, varies="number", path="JOINT.tau_max",
              default="none", doc="the largest torque of its servo on it, either way, likewise"),
    ),
)  # fmt: skip

PAYLOAD_AT = Parameter(name="at", unit="m", shape="vector", default=ZEROS, doc="the payload's frame in the link's")
PAYLOAD_RPY = Parameter(
    name="rpy",
    unit="rad",
    shape="vector",
    default=ZEROS,
    doc="turns of the payload's frame about fixed x, y, z of the link's",
)
GRAPPLE = Parameter(name="grapple", unit="s", at_least=0.0, doc="time at which the link grapples it")
RELEASE = Parameter(name="release", unit="s", at_least=0.0, doc="time at which the link releases it")
POSITION = Parameter(name="position", unit="m", shape="vector", doc="the payload's frame at the start, world axes")
ATTITUDE = Parameter(name="attitude", unit="rad", shape="vector", default=ZEROS, doc="its turns about fixed x, y, z")
VELOCITY = Parameter(name="velocity", unit="m/s", shape="vector", default=ZEROS, doc="of its frame, world axes")
RATE = Parameter(name="rate", unit="rad/s", shape="vector", default=ZEROS, doc="its angular velocity, world axes")


def _as_of_a_link(entry: Entry) -> Entry:
    return Entry(
        name=entry.name,
        written=entry.written,
        doc=entry.doc.replace("link frame", "its own frame")
        .replace("link axes", "its own axes")
        .replace("; `0 kg` makes the link a frame, without inertia", ""),
        default=entry.default,
        parameter=entry.parameter,
        varies=entry.varies,
        path=entry.path.replace("links.LINK", "payloads.PAYLOAD"),
    )


def _of_flight(wanted: Parameter, doc: str, default: str, written: str) -> Entry:
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
        Entry(name="on", written="on = LINK;", doc="the link that carries or grapples it, `base` too"),
        Entry(name="at", written="at = [0.1, 0, 0] m;", parameter=PAYLOAD_AT, varies="number", default="0",
              path="payloads.PAYLOAD.at",
              doc="the payload's frame in the link's; of one that is grappled, where it should come to"),
        Entry(name="rpy", written="rpy = [0, 0, 90] deg;", parameter=PAYLOAD_RPY, varies="number", default="0",
              path="payloads.PAYLOAD.rpy",
              doc="the turn of its frame in the link's, of one that is held from the start"),
        Entry(name="grapple", written="grapple = 2 s;", parameter=GRAPPLE, varies="number",
              path="payloads.PAYLOAD.grapple", default="left out: held from the start",
              doc="the time at which the link grapples it"),
        Entry(name="release", written="release = 5 s;", parameter=RELEASE, varies="number",
              path="payloads.PAYLOAD.release", default="left out: never", doc="the time at which it is released"),
        _of_flight(POSITION, "origin of its frame at the start, world axes", "needed where it is grappled",
                   "position = [1, 0, 0] m;"),
        _of_flight(ATTITUDE, "its turns about fixed x, y, z there, where it is grappled", "0",
                   "attitude = [0, 0, 90] deg;"),
        _of_flight(VELOCITY, "velocity of its frame's origin there, world axes, where it is grappled", "0",
                   "velocity = [0, 1, 0] cm/s;"),
        _of_flight(RATE, "its angular velocity there, world axes, where it is grappled", "0",
                   "rate = [0, 0, 1] deg/s;"),
    ),
)  # fmt: skip

ARM = BlockDeclaration(
    name="arm",
    written="arm NAME { ... }",
    doc="Links, and joints that hold them.",
    entries=(
        Entry(name="link", form="named", written="link NAME { ... }", doc="a link: `met doc link`"),
        Entry(name="joint", form="named", written="joint NAME revolute { ... }", doc="a joint: `met doc joint`"),
    ),
)
