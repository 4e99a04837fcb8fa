"""A robot as an initial deck: its arm entry by entry, other data of the file as comments, and first runs.

What is printed of the arm are the entries themselves, so the deck's arm is the one that `from urdf(...)` makes, number
for number. The first run holds the arm; where the file has damping or friction, another lets it fall under these.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence

from ic.grammar.syntax import Call, Expression, List, Setting, String, spell
from ic.robots.attributes import printable
from ic.robots.entries import LIMITS, ArmEntries, RobotEntry, spelled
from ic.robots.following import hold_position
from ic.robots.names import word
from ic.robots.robot import MOVING, Inertial, Mimic, Robot, RobotJoint
from ic.robots.warnings import in_other_units, incomplete, unseen_words
from ic.text.edition import EDITION_WORD, LATEST

WIDE = 100  # columns of a block on one line
WIDEST = 120  # with its comment
FAST = "10 kHz"  # for actuators, which decay with up to 3400 1/s in published models


def print_deck(body: ArmEntries, title: str) -> Iterator[str]:
    """The deck's lines. title: its first comment."""
    arm = arm_name(body)
    yield f"// {_safe(title)}"
    yield from _about(body)
    yield f"{EDITION_WORD} {LATEST};"
    yield ""
    yield f"arm {arm} {{"
    changed = {(change.kind, change.name): change.written.text for change in body.names.changed}
    for part in (*([body.base] if body.base is not None else []), *body.links):
        yield from _block(part, _link_notes(part, changed))
    yield ""
    for part in body.joints:
        yield from _block(part, _joint_notes(part, changed))
    yield "}"
    yield from _runs(body, arm)


def arm_name(body: ArmEntries) -> str:
    stem = os.path.basename(body.robot.file).partition(".")[0]
    return word(body.robot.name or stem, "arm")


def _about(body: ArmEntries) -> Iterator[str]:
    """The comments at the head of a deck from a robot's file: its base, and what is left out."""
    weighs = body.base is not None and body.base.weighs
    weight = " Its mass counts in a run with `base = free;`." if weighs else ""
    if not weighs and body.robot.root.inertial is not None:
        weight = " Its inertia is left out: no body has it."
    what = "body" if body.robot.format == "MJCF" else "link"
    yield f"// `base` is the file's {what} `{_safe(body.robot.root.name.text)}`.{weight}"
    if body.robot.dropped:
        yield f"// Not in this deck: {_counted(body.robot.dropped)}."


def _counted(dropped: Mapping[str, Sequence[object]]) -> str:
    kinds = sorted(dropped.items(), key=lambda kind: (-len(kind[1]), kind[0]))
    return ", ".join(f"{len(elements)} {_safe(what)}" for what, elements in kinds)


def remarks(body: ArmEntries) -> Iterator[str]:
    """Yield remarks for people who import the robot, a line each: what the deck lacks, changes or assumes."""
    attributes = {what: elements for what, elements in body.robot.dropped.items() if " of " in what}
    if attributes:
        yield f"attributes not read, and not in the deck: {_counted(attributes)}"
    yield from (f"{unseen_words(len(elements))} {reason}" for reason, elements in body.robot.unseen.items())
    yield from ways_on(body.robot)
    yield from (remark.text for remark in in_other_units(body.robot))
    yield from incomplete(body.robot)
    if body.no_body:
        yield f"the inertia of `{printable(body.robot.root.name.text)}`, the base, is not in the deck: {body.no_body}"
    for joint in body.robot.joints:
        if joint.beyond:
            yield f"joint `{printable(joint.name.text)}` is held at {spelled(joint.held)}, beyond {joint.beyond}"


def _block(part: RobotEntry, notes: list[str]) -> Iterator[str]:
    """An entry on one line where it is short, else a line for each key; notes behind the first line, or above it."""
    words = " ".join(word.text for word in part.entry.words)
    entries = [entry for entry in part.entry.body if isinstance(entry, Setting)]
    settings = [(entry.path[0].text, f"{_spelled(entry.value)};") for entry in entries]
    note = f"// {'; '.join(map(_safe, notes))}" if notes else ""
    rows = _rows(settings)
    line = f"    {words} {{ {'  '.join(f'{key} = {value}' for key, value in settings)} }}"
    first = line if len(line) <= WIDE else f"    {words} {{"
    if note and len(f"{first}  {note}") > WIDEST:
        yield f"    {note}"
        note = ""
    yield f"{first}  {note}".rstrip()
    if first == line:
        return
    width = max((len(row[0][0]) for row in rows), default=0)
    for (key, value), *rest in rows:
        yield "  ".join((f"        {key:{width}} = {value}", *(f"{other} = {text}" for other, text in rest)))
    yield "    }"


def _spelled(value: Expression) -> str:
    """The text of a value; of a list of meshes, a line for each."""
    if isinstance(value, List) and all(isinstance(mesh, Call | String) for mesh in value.items):
        return f"[{''.join(f'{chr(10)}            {spell(mesh)},' for mesh in value.items)}\n        ]"
    return spell(value)


def _rows(settings: list[tuple[str, str]]) -> list[list[tuple[str, str]]]:
    """The settings of a block, by line: a joint's parent and child, and its limits, each on one line if that is
    short."""
    limited = [setting for setting in settings if setting[0] in LIMITS.values()]
    ends = [setting for setting in settings if setting[0] in ("parent", "child")]
    others = [[setting] for setting in settings if setting not in ends and setting not in limited]
    short = sum(len(f"  {key} = {value}") for key, value in limited) <= WIDE
    return [
        *([ends] if ends else []),
        *others,
        *([limited] if limited and short else [[setting] for setting in limited]),
    ]


def _link_notes(part: RobotEntry, changed: Mapping[tuple[str, str], str]) -> list[str]:
    """Remarks on a link for a deck that is made from a robot's file."""
    notes = _called(part, "link", changed)
    inertial = getattr(part.source, "inertial", None)
    if isinstance(inertial, Inertial) and inertial.rpy is not None and inertial.is_turned:
        notes.append(f"inertia turned from axes at rpy {' '.join(map(spelled, inertial.rpy.values))}")
    return notes


def _joint_notes(part: RobotEntry, changed: Mapping[tuple[str, str], str]) -> list[str]:
    """Remarks on a joint for a deck that is made from a robot's file: its name there, and what a deck has elsewhere."""
    notes = _called(part, "joint", changed)
    joint = part.source
    assert isinstance(joint, RobotJoint)
    if joint.type.text == "continuous":
        notes.append("continuous")
    if joint.followed is not None:
        notes.append(_following(joint, joint.followed))
    if joint.type.text in MOVING:
        notes += [f"{name} {spelled(value)}" for name, value in joint.friction.items() if value]
    return notes


def _following(joint: RobotJoint, mimic: Mimic) -> str:
    """A note on a joint that follows another in the file."""
    law = {"multiplier": (mimic.multiplier, 1.0), "offset": (mimic.offset, 0.0)}
    shown_law = ", ".join(f"{name} {spelled(value)}" for name, (value, default) in law.items() if value != default)
    in_deck = f"here it is held at {spelled(joint.held)}" if joint.type.text == "fixed" else "here it moves by itself"
    in_deck += f", beyond {joint.beyond}" if joint.beyond else ""
    return f"follows `{printable(mimic.joint.text)}` in the file{f' ({shown_law})' if shown_law else ''}; {in_deck}"


def _called(part: RobotEntry, kind: str, changed: Mapping[tuple[str, str], str]) -> list[str]:
    name = changed.get((kind, part.entry.words[1].text))
    return [] if name is None else [f"`{printable(name)}` in the file"]


# Runs to begin with


def _runs(body: ArmEntries, arm: str) -> Iterator[str]:
    """The lines of the servos and of the runs `hold` and `fall`; none for an arm that does not move."""
    joints = {
        part.entry.words[1].text: part.source
        for part in body.joints
        if isinstance(part.source, RobotJoint) and part.source.type.text in MOVING
    }
    if not joints:
        return
    taken = {*joints, *(part.entry.words[1].text for part in body.links)}
    held, slide = _free("held", taken), _free("held_slide", taken)
    poses = {name: hold_position(joint) for name, joint in joints.items()}
    slides = [name for name, joint in joints.items() if joint.type.text == "prismatic"]
    yield ""
    yield "// Each joint is held, and `tau` is what that takes. Put servos of yours in the place of these."
    yield f"servo {held} {{ model = ideal;  bandwidth = 20 1/s;  command = position(0 rad); }}"
    if slides:
        yield f"servo {slide} like {held} {{ command = position(0 m); }}"
    yield ""
    yield "default run hold {"
    yield f"    arm         = {arm};"
    yield from ["    base        = free;"] if body.robot.base_pose is not None else []
    yield "    servos      {"
    driven = [name for name, joint in joints.items() if joint.mimic is None]
    for name in driven:
        servo, position = slide if name in slides else held, _position_text(poses[name], name in slides)
        own = f" {{ command = position({position}); }}" if poses[name] else ""
        middle = bool(own) and joints[name].start is None
        yield f"        {name} = {servo}{own};" + ("  // the middle of its range, which 0 is not in" if middle else "")
    yield "    }"
    moved = [f"{name}.q = {_position_text(poses[name], name in slides)};" for name in driven if poses[name]]
    if body.robot.base_pose is not None:
        pose = zip(("position", "rpy"), body.robot.base_pose, ("m", "rad"), strict=True)
        moved += [f"base.{key} = {_list(values)} {unit};" for key, values, unit in pose if any(values)]
    start = f"  // {_safe(body.robot.keyframe)}" if body.robot.keyframe else ""
    yield from ([f"    initial {{{start}", *(f"        {entry}" for entry in moved), "    }"] if moved else [])
    yield f"    environment {{ gravity = {_list(body.robot.gravity)} m/s^2; }}"
    yield "    rates       { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }"
    yield "    duration    = 1 s;"
    yield "    record      = [q, tau];"
    yield "}"
    for run, comment, servos, laws in _passive_runs(body.robot, joints, taken):
        yield from _passive_run(run, comment, servos, laws, slides)


Laws = Mapping[str, Mapping[str, float]]
"""Values of the keys of `passive`, by joint."""


def _passive_runs(
    robot: Robot, joints: Mapping[str, RobotJoint], taken: Collection[str]
) -> Iterator[tuple[str, str, Mapping[str, str], Laws]]:
    """Runs on the servo `passive` that the file has numbers for: name, comment, servos by joint, and their keys."""

    def servos(ending: str) -> dict[str, str]:
        return {name: _free(f"{name}_{ending}", taken) for name in joints}

    laws = {name: joint.friction for name, joint in joints.items()}
    if any(joint.friction_at is not None for joint in joints.values()):
        more = {"springs": "stiffness", "rotors": "rotor"}
        listed = [what for what, key in more.items() if any(law.get(key) for law in laws.values())]
        *first, last = ["damping", "friction", *listed]
        yield "fall", f"The joints let go, with the {', '.join(first)} and {last} of the file.", servos("bearing"), laws
    if any(joint.drive for joint in joints.values()):
        controls = f"at the controls of {_safe(robot.keyframe)}" if robot.keyframe else "at the controls 0"
        comment = f"Actuators as springs and dampers, {controls}, with all of `fall`. No force is limited."
        both = {name: joint.drive or joint.friction for name, joint in joints.items()}
        yield "drive", comment, servos("actuator"), both


def _passive_run(
    run: str, comment: str, servos: Mapping[str, str], laws: Laws, slides: Collection[str]
) -> Iterator[str]:
    """The lines of a run like `hold` with the servo `passive` on each joint."""
    yield ""
    yield f"// {comment}"
    for name, law in laws.items():
        way, inertia = ("m", "kg") if name in slides else ("rad", "kg*m^2")
        effort = "N" if name in slides else "N*m"
        units = {
            "damping": f"{effort}*s/{way}",
            "friction": effort,
            "stiffness": f"{effort}/{way}",
            "rest": way,
            "rotor": inertia,
        }
        keys = "".join(f"  {key} = {spelled(value)} {units[key]};" for key, value in law.items() if value)
        yield f"servo {servos[name]} {{ model = passive;{keys} }}"
    yield ""
    yield f"run {run} like hold {{"
    yield from [f"    rates {{ dynamics = {FAST}; }}"] if run == "drive" else []
    yield "    servos {"
    for name in laws:
        yield f"        {name} = {servos[name]};"
    yield "    }"
    yield "}"


def _list(values: Sequence[float]) -> str:
    return f"[{', '.join(map(spelled, values))}]"


def _position_text(value: float, slides: bool) -> str:
    return f"{spelled(value)} {'m' if slides else 'rad'}"


def _free(name: str, taken: Collection[str]) -> str:
    """The name, with underscores appended while it is a joint's or a link's."""
    while name in taken:
        name += "_"
    return name


def _safe(text: str) -> str:
    """Text that stays in its comment: printable, and no backslash, which would join the next line to it."""
    return "".join(c if c.isprintable() and c != "\\" else "?" for c in text)


CLOSED = "the loop is open in the deck: a stiff `bushing` of the environment closes it, or a `loop` of the arm"
SERVO = "a servo drives a joint, `servo NAME { model = MODEL; ... }`"
WAYS = {
    "geom": "mass and inertia are in the deck; a `contact` of the environment lets two links touch",
    "contact": "a `contact` of the environment lets two links touch",
    "connect": CLOSED,
    "weld": CLOSED,
    "equality": "in the deck, `follows`, `ratio` and `offset` couple joints by a straight line, without circles",
    "tendon": "a cable between two points is a `spring` of the environment; joints that move together are `follows`",
    "sensor": "the run's `record` names what is recorded, and `sensor NAME = MODEL { link = LINK; ... }` measures",
    "site": "a place on a link is a link of `mass = 0 kg` on a fixed joint",
    "body": "the arm does not carry it: a `payload` of the run is a body that the arm grapples or releases",
    "key": "a run `like hold` with another `initial` begins there",
    **dict.fromkeys(
        ("general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle", "adhesion",
         "dcmotor"), SERVO),
    "plugin": "a model of your own does it: `met new servo`, `met new environment`",
    "gravcomp of body": "a `wrench` of the environment holds the weight of a link",
}  # fmt: skip
"""Others are for pictures, for MuJoCo's solver, or without a counterpart."""


def ways_on(robot: Robot) -> Iterator[str]:
    """Yield a line for each kind of what is not read, if a deck can say it in another way."""
    for what, elements in robot.dropped.items() if robot.format == "MJCF" else ():
        if what in WAYS:
            yield f"not in the deck: {len(elements)} {what}: {WAYS[what]}"
