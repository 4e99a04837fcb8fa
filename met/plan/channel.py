"""Channels: every number of a structure that can be recorded, watched by a metric, or plotted.

    <joint>.q .qd .qdd              position, rate, acceleration (rad ...; m ... on a prismatic joint)
    <joint>.tau                     torque on the joint from its servo, rotor's share included (N m; N)
    <joint>.servo.<name>            a servo's memory, state or signal, by its declaration
    <joint>.servo.sensor.<of>       what the servo's law sees of a quantity through a sensor
    <joint>.servo.sensor.<of>.<name>                            the sensor's states
    <joint>.servo.command           what the servo was asked at its last tick, in the command's unit
    <joint>.bed.<name>              of a joint whose motor is on a bed: the bed's memory, by its declaration
    <joint>.bed.drive_voltage .load_current                     what the bed's amplifiers hold (V, A);
                                                                .drive_torque (N m), .drive_rate (rad/s) of a
                                                                drive that is told one
    <joint>.law.<name>              the law's memory, by its declaration
    <joint>.law.torque .rate        load torque that the law asks (N m), rate of the shaft that it believes (rad/s)
    <joint>.law.unknown_torque .reference_rate                  of a law with an observer

    guides.<guide>.<name>           what a guide's computer shows, by its declaration
    sensors.<sensor>                what a sensor of a link reads
    sensors.<sensor>.<name>         its states

Derived channels, computed from the state only where a record or a metric asks for them (docs/physics.md, section 1):

    <joint>.tau_load .J_eff .b      what the arm takes, tau_load = J_eff qdd + b, all other joints in their modes
    <joint>.mode                    1 in torque mode, 0 in acceleration mode
    <joint>.limit_margin            room to the nearest of the joint's limits, a share; limits.margin: the least of all
    <joint>.reaction.moment|force   what the link takes from its parent: about its frame's origin, in its axes; not of a
                                    joint in a loop
    links.<link>.position, .orientation, .velocity, .rate       of the link's frame, in world axes
    links.<boom>.deflection, .bend  of the tip of a link that bends, against its root
    links.<boom>.displacement       of that tip, against the arm with straight booms
    links.<link>.jacobian.angular|linear.<joint>                rate and velocity for each unit of the joint's rate
    energy.kinetic|potential, momentum.linear|angular           of all that the joints move, and of payloads
    payloads.<payload>.position, .orientation, .velocity, .rate of the payload's frame, in world axes
    payloads.<payload>.distance     from the point `at` of its link to its frame
    payloads.<payload>.carried      1 while its link carries it, 0 while it flies
    environment.<model>.<name>      what an environment model shows, by its declaration

Computed of other channels, at each instant of the dynamics or tick at which one of these is sampled:

    signals.<name>                  an expression under a name of the deck's
    <expression>                    what a metric watches, as the deck wrote it

A vector is one channel a component: `links.tip.position.x`, `links.tip.orientation.w`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping
from functools import lru_cache

from met import models, units
from met.frozen import frozen
from met.plan import Joint, Recorded, Structure
from met.plan.closing import in_loops
from met.plan.uses import quantities, sensor_parts, servo_parts
from met.unit_parser import parse_unit

MOTION = (
    ("q", "joint", "joint position"),
    ("qd", "joint/s", "joint rate"),
    ("qdd", "joint/s^2", "joint acceleration"),
    ("tau", "effort", "torque of the servo on the joint"),
)

XYZ, WXYZ = ("x", "y", "z"), ("w", "x", "y", "z")
DIMENSIONS = {XYZ: "axis", WXYZ: "quaternion"}
"""Names of the archive's dimensions by the components of a vector."""

JOINT_AXIS = "about or along the joint's axis"
WORLD_AXES = "world axes"
CONTINUOUS = "to world axes; w >= 0 at the start, then without jumps"

# Name, unit, meaning, components, frame.
OF_JOINT = (
    ("tau_load", "effort", "part of the joint's torque that goes into the arm", (), JOINT_AXIS),
    ("J_eff", "inertia", "effective inertia of the arm at the joint", (), JOINT_AXIS),
    ("b", "effort", "rest of the load on the joint: tau_load - J_eff qdd", (), JOINT_AXIS),
    ("mode", "1", "1 if the joint's torque is given, 0 if its acceleration is given, as in stiction", (), ""),
    (
        "reaction.moment",
        "N*m",
        "moment that the joint exerts on its link",
        XYZ,
        "link axes, about the link frame's origin",
    ),
    ("reaction.force", "N", "force that the joint exerts on its link", XYZ, "link axes"),
)
OF_LINK = (
    ("position", "m", "position of the origin of the link's frame", XYZ, WORLD_AXES),
    ("orientation", "1", "orientation of the link's frame, a unit quaternion", WXYZ, f"from link axes {CONTINUOUS}"),
    ("velocity", "m/s", "velocity of the link frame's origin", XYZ, WORLD_AXES),
    ("rate", "rad/s", "angular velocity of the link", XYZ, WORLD_AXES),
)
OF_BOOM = (
    (
        "deflection",
        "m",
        "way from the tip of the straight boom to that of the bent one",
        XYZ,
        "axes of the boom's root",
    ),
    ("bend", "rad", "angle of the boom's tip against its root", XYZ, "about each axis of the boom"),
    ("displacement", "m", "way to the boom's tip from where it would be if all booms were straight", XYZ, WORLD_AXES),
)
OF_PAYLOAD = (
    ("position", "m", "position of the origin of the payload's frame", XYZ, WORLD_AXES),
    (
        "orientation",
        "1",
        "orientation of the payload's frame, a unit quaternion",
        WXYZ,
        f"from payload axes {CONTINUOUS}",
    ),
    ("velocity", "m/s", "velocity of the payload frame's origin", XYZ, WORLD_AXES),
    ("rate", "rad/s", "angular velocity of the payload", XYZ, WORLD_AXES),
    ("distance", "m", "distance of the payload's frame from its place on the link", (), ""),
    ("carried", "1", "1 while the link carries the payload, 0 while it flies freely", (), ""),
)
JOINT_LIMITS = {"q_min": "joint", "q_max": "joint", "qd_max": "joint/s", "tau_max": "effort"}
"""Limits that a joint may have, with their declared units."""

LIMIT_MARGIN = (
    "limit_margin",
    "1",
    "distance to the nearest of the joint's limits, as a share of the range, rate or torque; negative beyond it",
    (),
    "",
)
"""The `limit_margin` channel of joints with limits, as an entry of `OF_JOINT`."""

JACOBIAN = (
    ("jacobian.angular", "angular", "angular velocity of the link per unit of the joint's rate"),
    ("jacobian.linear", "linear", "velocity of the link frame's origin per unit of the joint's rate"),
)
OF_ARM = (
    ("energy.kinetic", "J", "kinetic energy, including that of rotors and motors", (), ""),
    ("energy.potential", "J", "potential energy of gravity, of wound-up gears and of springs", (), ""),
    ("limits.margin", "1", "smallest `limit_margin` of all joints that have limits", (), ""),
    ("momentum.linear", "kg*m/s", "linear momentum", XYZ, WORLD_AXES),
    ("momentum.angular", "kg*m^2/s", "angular momentum about the world's origin", XYZ, WORLD_AXES),
)

FAMILIES = {
    "reaction": ("moment", "force"),
    "jacobian": ("angular", "linear"),
    "energy": ("kinetic", "potential"),
    "momentum": ("linear", "angular"),
}
"""Names that stand for several variables: `reaction` is `reaction.moment` and `reaction.force`."""

COMMAND_UNIT = {"rate": "joint/s", "position": "joint", "torque": "effort", "acceleration": "joint/s^2"}

REPEATED = re.compile(r"/s(?:\^\d)?(?:/s(?:\^\d)?\b)+")
POWER = re.compile(r"/s(?:\^(\d))?")

TURNING = {"joint": "rad", "effort": "N*m", "inertia": "kg*m^2", "angular": "1", "linear": "m/rad"}
SLIDING = {"joint": "m", "effort": "N", "inertia": "kg", "angular": "rad/m", "linear": "1"}
"""Words of declared units, with their meanings for a revolute and for a prismatic joint."""


@frozen
class Channel:
    """One number that changes in time.

    divisor     base ticks between its samples; between them it is held
    joint       the joint that it is of; none for what a link or the arm has
    components  of the vector that it is a component of; none where it is no vector's
    frame       the axes that it is given in, in words
    derived     whether it is computed only where it is asked for
    """

    path: str
    unit: str
    doc: str
    divisor: int
    joint: str = ""
    components: tuple[str, ...] = ()
    frame: str = ""
    derived: bool = False


def joint_unit(unit: str, joint: Joint, command: str | None = None) -> str:
    """A declared unit with `joint`, `effort` and `command` replaced: `joint/s` -> `rad/s`, or `m/s`."""
    return _unit_of(unit, joint.kind == "prismatic", command)


def ratio_unit(kind: str, leader_kind: str) -> str:
    """The unit of a ratio of the position of a joint of one kind to that of another kind, which leads."""
    units = {"prismatic": "m", "revolute": "rad"}
    return "1" if kind == leader_kind else f"{units.get(kind, '1')}/{units.get(leader_kind, '1')}"


@lru_cache(maxsize=4096)
def _unit_of(unit: str, slides: bool, command: str | None) -> str:
    """A channel's unit at a joint, from the declared one with placeholders. slides: whether the joint is prismatic;
    command: the kind of its servo's command, None where it does not matter."""
    replacements = SLIDING if slides else TURNING
    if command is not None:
        replacements = {**replacements, "command": _unit_of(COMMAND_UNIT[command], slides, None)}
    out, word = "", ""
    for character in unit + " ":
        if character.isalpha() or character == "_":
            word += character
            continue
        out += _factor(replacements.get(word, word), out) + character
        word = ""
    return REPEATED.sub(_per_time, out.strip())


def watched_unit(declared: str, watched: str) -> str:
    """A metric's declared unit with `of` replaced by the unit of the watched channel: for `rad/s`, `of*s` is `rad`."""
    if declared == "of" or "of" not in re.findall(r"[A-Za-z_]+", declared):
        return watched if declared == "of" else declared
    return units.text(parse_unit(declared, {"of": parse_unit(watched)}).dimension)


def _per_time(repeated: re.Match[str]) -> str:
    """A repeated division combined: `rad/s/s` is `rad/s^2`."""
    return f"/s^{sum(int(power or 1) for power in POWER.findall(repeated[0]))}"


def _factor(unit: str, before: str) -> str:
    """A unit as a factor; a product or quotient in a denominator gets its brackets."""
    return f"({unit})" if before.endswith("/") and ("*" in unit or "/" in unit) else unit


def channels(structure: Structure, names: Iterable[str] = ()) -> dict[str, Channel]:
    """Every channel of the structure, by path: joint by joint, then the links', then the arm's.

    Jacobians, whose number is links times joints, are listed for the first link and for links that are mentioned: in
    these names, or by the structure's own record and metrics. Channels of joints, links and models of the environment
    are all listed.
    """
    own = [*(recorded.name for recorded in structure.record), *(use.of for use in structure.metrics)]
    return _channels(structure, [*names, *own], all_owners=True)


def channels_beside(structure: Structure, paths: Iterable[str]) -> dict[str, Channel]:
    """The existing channels among these paths, with all others of the same joints and links, and of the arm."""
    return _channels(structure, list(paths), all_owners=False)


def _channels(structure: Structure, names: list[str], *, all_owners: bool) -> dict[str, Channel]:
    """The channels of a structure. all_owners: those of every joint and link; else those of joints and links in the
    names and in the structure's expressions."""
    servos = {use.joint: use for use in structure.servos}
    on_beds = {use.joint: use for use in structure.substitutions}
    dynamics = structure.schedule.dynamics
    by_path: dict[str, Channel] = {}

    def add(path: str, unit: str, doc: str, divisor: int, joint: str, frame: str = "") -> None:
        by_path[path] = Channel(path, unit, doc, divisor, joint, (), frame)

    def derive(path: str, unit: str, doc: str, components: tuple[str, ...], frame: str, joint: str = "") -> None:
        for part_path in [f"{path}.{component}" for component in components] or [path]:
            by_path[part_path] = Channel(part_path, unit, doc, dynamics, joint, components, frame, True)

    mentions = [*names, *(path for expression in structure.expressions for path in expression.channels)]
    joints = {name.partition(".")[0] for name in mentions}
    looped = in_loops(structure.joints)
    for joint in structure.moving:
        if not all_owners and joint.name not in joints:
            continue
        for name, unit, doc in MOTION:
            add(f"{joint.name}.{name}", joint_unit(unit, joint), doc, dynamics, joint.name, JOINT_AXIS)
        for name, unit, doc, components, frame in (*OF_JOINT, *([LIMIT_MARGIN] if joint.limits else [])):
            if (joint.follows and name in ("J_eff", "b")) or (joint.name in looped and name.startswith("reaction.")):
                continue
            derive(f"{joint.name}.{name}", joint_unit(unit, joint), doc, components, frame, joint.name)
        use = servos.get(joint.name)
        if use is None:
            continue
        of_servo = servo_parts(use)
        kind = use.command.kind if use.command is not None else None
        if kind is not None:
            unit = joint_unit(COMMAND_UNIT[kind], joint)
            add(f"{joint.name}.servo.command", unit, f"{kind} command of the servo", use.divisor, joint.name)
        for divisor, held in ((use.divisor, of_servo.memory), (dynamics, (*of_servo.states, *of_servo.shown))):
            for part in held:
                unit = joint_unit(part.unit, joint, kind)
                add(f"{joint.name}.servo.{part.name}", unit, part.doc, divisor, joint.name)
        for sensor in use.sensors:
            unit = joint_unit(quantities(use)[sensor.of], joint, kind)
            path = f"{joint.name}.servo.sensor.{sensor.of}"
            add(path, unit, f"{sensor.of}, as the servo's sensor reads it", use.divisor, joint.name)
            for state in sensor_parts(sensor, "states"):
                add(f"{path}.{state.name}", watched_unit(state.unit, unit), state.doc, dynamics, joint.name)
        if joint.name in on_beds:
            bed, law = (models.find(kind, getattr(on_beds[joint.name], kind)) for kind in ("bed", "law"))
            for name, unit, doc in bed.shown:
                add(f"{joint.name}.bed.{name}", joint_unit(unit, joint), doc, use.divisor, joint.name)
            for name, unit, doc in law.shown:
                add(f"{joint.name}.law.{name}", joint_unit(unit, joint), doc, use.divisor, joint.name)
    for guide in structure.guides:
        for part in models.find("guide", guide.model, guide.place).memory:
            add(f"guides.{guide.name}.{part.name}", part.unit, part.doc, guide.divisor, "")
    for on_link in structure.sensors:
        unit, path = models.find("sensor", on_link.model, on_link.place).unit, f"sensors.{on_link.name}"
        add(path, unit, f"reading of the {on_link.model}", on_link.divisor, "")
        for state in sensor_parts(on_link, "states"):
            add(f"{path}.{state.name}", watched_unit(state.unit, unit), state.doc, dynamics, "")
    mentioned = {name.split(".")[1] for name in mentions if name.startswith("links.")}
    mentioned |= {link.name for link in structure.links[:1]}
    for link in structure.links:
        if not all_owners and link.name not in mentioned:
            continue
        for name, unit, doc, parts, frame in (*OF_LINK, *(OF_BOOM if link.root else ())):
            derive(f"links.{link.name}.{name}", unit, doc, parts, frame)
        if link.name not in mentioned:
            continue
        carrying = _carrying(structure, link.name)
        for name, unit, doc in JACOBIAN:
            for joint in carrying:
                path = f"links.{link.name}.{name}.{joint.name}"
                derive(path, joint_unit(unit, joint), doc, XYZ, WORLD_AXES, joint.name)
    for payload in structure.payloads:
        for name, unit, doc, several, frame in OF_PAYLOAD:
            derive(f"payloads.{payload.name}.{name}", unit, doc, several, frame)
    for load in structure.environment:
        for signal in models.find("environment", load.model, load.place).signals:
            own = f"environment.{load.name}.{signal.name}"
            derive(own, _unit_of(signal.unit, load.slides, None), signal.doc, XYZ if signal.axes else (), signal.axes)
    limited = any(joint.limits for joint in structure.moving)
    for name, unit, doc, components, frame in OF_ARM:
        if limited or name != "limits.margin":
            derive(name, unit, doc, components, frame)
    for expression in structure.expressions:
        divisor = math.gcd(*(by_path[path].divisor for path in expression.channels)) or dynamics
        add(expression.name, expression.unit, expression.text, divisor, "")
    return by_path


def _carrying(structure: Structure, link: str) -> list[Joint]:
    """The moving joints between a link and the base, in the order of `moving`; those that lead in place of those that
    follow them."""
    holds = {joint.child: joint for joint in structure.joints}
    chain: set[str] = set()
    while link in holds and holds[link].name not in chain:  # a broken tree is reported elsewhere
        chain.add(holds[link].name)
        link = holds[link].parent
    for joint in reversed(structure.moving):  # leaders of leaders, in whatever order the deck has them
        chain |= {name for moving in structure.moving if moving.name in chain for name in moving.follows} & {joint.name}
    return [joint for joint in structure.independent if joint.name in chain]


def carries(structure: Structure, link: str, joint: str) -> bool:
    """True where a moving joint lies between the link and the base."""
    return joint in {carrying.name for carrying in _carrying(structure, link)}


def channel_paths(name: str, joints: tuple[str, ...], components: tuple[str, ...]) -> tuple[str, ...]:
    """The channels of a variable of these joints (none: of one thing): joint by joint, component by component."""
    inner = name.startswith("links.")  # links.tip.jacobian.linear.elbow.x, but elbow.reaction.force.x
    owners = [f"{name}.{joint}" if inner else f"{joint}.{name}" for joint in joints] or [name]
    return tuple(f"{owner}.{part}" for owner in owners for part in components) if components else tuple(owners)


def joint_of(name: str) -> str:
    """The joint in the name of a variable; none where the variable belongs to no joint."""
    if name.startswith(
        ("links.", "payloads.", "guides.", "sensors.", "signals.", "environment.", *(own for own, *_ in OF_ARM))
    ):
        return ""
    return name.partition(".")[0]


def recordable(
    structure: Structure,
    names: Iterable[str] = (),
    known: Mapping[str, Channel] | None = None,
    *,
    wanted: Collection[str] | None = None,
) -> dict[str, tuple[Recorded, ...]]:
    """Every name that a record may write, with the variables that it stands for.

    names   as of `channels`;  known: what that comes to, where it is at hand
    wanted  those names alone, as far as there are such; None: all

    A name stands for one number (`elbow.q`, `elbow.reaction.force.x`), for a vector (`links.tip.position`), for the
    values of all joints that have it (`q`, `reaction.force`), or for several variables (`reaction`, `energy`;
    `sensors`: readings of those of links).
    """
    known = channels(structure, names) if known is None else known
    own: dict[str, Channel] = {}  # numbers and vectors, a vector before its components
    joints: dict[str, list[str]] = {}
    for path, channel in known.items():
        vector = path.rpartition(".")[0] if channel.components else ""
        for name in (vector, path) if vector and vector not in own else (path,):
            own[name] = channel
            group = _of_all(name, channel) if channel.joint else ""
            if group != "q" and channel.joint in structure.springs:
                continue  # of a boom's spring only what draws it belongs to all joints' values
            if group:
                joints.setdefault(group, []).append(channel.joint)
    by_name: dict[str, tuple[Recorded, ...]] = {}

    def is_wanted(name: str) -> bool:
        return wanted is None or name in wanted or name.rpartition(".")[0] in wanted

    for name, channel in own.items():
        if is_wanted(name):
            _enter(by_name, known, name, (), () if name in known else channel.components)
    for name, joint_names in joints.items():
        if not is_wanted(name):
            continue
        (first_path,) = channel_paths(name, (joint_names[0],), ())
        _enter(by_name, known, name, tuple(joint_names), () if first_path in known else own[first_path].components)
    if structure.sensors and wanted is None:
        by_name["sensors"] = tuple(by_name[f"sensors.{use.name}"][0] for use in structure.sensors)
    return by_name if wanted is None else {name: recorded for name, recorded in by_name.items() if name in wanted}


def _of_all(name: str, channel: Channel) -> str:
    """The name of the variable of all joints to which a joint's channel belongs; "" for a single component of a
    jacobian."""
    if not channel.path.startswith("links."):
        return name.removeprefix(channel.joint + ".")
    return name.removesuffix("." + channel.joint) if name != channel.path else ""


def _enter(
    by_name: dict[str, tuple[Recorded, ...]],
    known: Mapping[str, Channel],
    name: str,
    joints: tuple[str, ...],
    components: tuple[str, ...],
) -> None:
    """Enter a variable, and add it to its family, which comes before its members."""
    scalars = channel_paths(name, joints, components)
    units = tuple(known[path].unit for path in scalars) if joints else (known[scalars[0]].unit,)
    recorded = Recorded(name, scalars, joints, units, known[scalars[0]].doc, components)
    family, _, member = name.rpartition(".")
    if member in FAMILIES.get(family.rpartition(".")[2], ()):
        by_name[family] = (*by_name.get(family, ()), recorded)
    by_name[name] = (recorded,)
