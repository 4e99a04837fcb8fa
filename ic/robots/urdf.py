"""The text of a URDF file to a `Robot`.

Links, joints and inertia are read; what else the file holds is counted by name, so that none of it is dropped in
silence. Joints of kinds that MET does not have are read too: an arm made from the file may remove or change them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ic.robots.attributes import (
    XACRO,
    number,
    number_or_none,
    numbers,
    only_child,
    refuse_unknown,
    required_child,
    shown,
    word,
)
from ic.robots.robot import TYPES, Inertial, Joint, Link, Numbers, Robot
from ic.robots.xml import Element, parse
from ic.text.complaints import Complaints, known_words
from ic.text.limits import MOST_LINKS
from met.diagnostic import Label, Place, Problem, did_you_mean, error

LIMITS = ("lower", "upper", "effort", "velocity")
FRICTION = ("damping", "friction")
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
MOST_NAMED = 6  # places of a fault in one message

_READ = {
    "robot": ("link", "joint"),
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
_FORMATS = {"sdf": "SDF", "mujoco": "MuJoCo's MJCF", "svg": "a drawing", "html": "a web page", "COLLADA": "a mesh"}


def read(name: str, text: str) -> Robot:
    """The robot of a file. Raises Problem with all its errors."""
    root = parse(name, text)
    for element in _within(root):
        if element.tag.startswith("xacro:"):
            raise Problem(error("D203", f"`<{shown(element.tag)}>` is not URDF", element.place, help=XACRO))
    if root.tag != "robot":
        kind = _FORMATS.get(root.tag)
        what = f": this is {kind}" if kind else ""
        raise Problem(
            error(
                "D203",
                f"`<{shown(root.tag)}>` is not URDF{what}",
                root.place,
                help='a URDF file is `<robot name="..."> ... </robot>`',
            )
        )
    for n, element in enumerate(root.all("link")):
        if n == MOST_LINKS:
            raise Problem(
                error(
                    "D202",
                    f"a robot has at most {MOST_LINKS} links",
                    element.place,
                    help="a robot has some ten: is this the right file?",
                )
            )
    complaints = Complaints()
    dropped: dict[str, list[Place]] = {}
    links, joints = [], []
    _drop(root, dropped)
    for element in root.all("link"):
        with complaints.gather():
            links.append(_link(element, dropped))
    for element in root.all("joint"):
        with complaints.gather():
            joints.append(_joint(element, dropped))
    _check_names(links, "link", complaints)
    _check_names(joints, "joint", complaints)
    if not complaints.errors:
        _check_ends(links, joints, complaints)
    if complaints.errors:
        raise Problem(complaints.errors)
    robot = root.attributes.get("name", "").strip()
    return Robot(
        name,
        robot,
        tuple(links),
        tuple(joints),
        _root(root, links, joints),
        {tag: tuple(places) for tag, places in dropped.items()},
    )


def _within(root: Element) -> Iterator[Element]:
    stack = [root]
    while stack:
        element = stack.pop()
        yield element
        stack.extend(reversed(element.children))


def _drop(element: Element, dropped: dict[str, list[Place]]) -> None:
    """Count the elements inside that are not read."""
    for child in element.children:
        if child.tag not in _READ[element.tag]:
            dropped.setdefault(child.tag, []).append(child.place)


def _link(element: Element, dropped: dict[str, list[Place]]) -> Link:
    name = word(element, "name", '<link name="...">')
    _drop(element, dropped)
    inertial = only_child(element, "inertial")
    return Link(name, None if inertial is None else _inertial(inertial, dropped))


def _inertial(element: Element, dropped: dict[str, list[Place]]) -> Inertial:
    _drop(element, dropped)
    com, rpy = _origin(element)
    mass = required_child(element, "mass", '<mass value="..."/>')
    refuse_unknown(mass, ("value",))
    inertia = required_child(element, "inertia", '<inertia ixx="..." iyy="..." izz="..." ixy="0" ixz="0" iyz="0"/>')
    refuse_unknown(inertia, MOMENTS)
    moments = [number(inertia, each) if each in MOMENTS[:3] else numbers(inertia, each, 1) for each in MOMENTS]
    values = tuple(0.0 if moment is None else moment.values[0] for moment in moments)
    each = tuple(inertia.place if moment is None else moment.place for moment in moments)
    return Inertial(number(mass, "value"), com, rpy, Numbers(values, inertia.place, each), element.place)


def _origin(element: Element) -> tuple[Numbers | None, Numbers | None]:
    """xyz and rpy of the `<origin>` inside."""
    origin = only_child(element, "origin")
    if origin is None:
        return None, None
    refuse_unknown(origin, ("xyz", "rpy"))
    return numbers(origin, "xyz", 3), numbers(origin, "rpy", 3)


def _joint(element: Element, dropped: dict[str, list[Place]]) -> Joint:
    name = word(element, "name", '<joint name="..." type="revolute">')
    kind = word(element, "type", '<joint name="..." type="revolute">')
    _drop(element, dropped)
    at, rpy = _origin(element)
    parent = word(required_child(element, "parent", '<parent link="..."/>'), "link", '<parent link="..."/>')
    child = word(required_child(element, "child", '<child link="..."/>'), "link", '<child link="..."/>')
    axis = only_child(element, "axis")
    if axis is not None:
        refuse_unknown(axis, ("xyz",))
    limit, dynamics, mimic = only_child(element, "limit"), only_child(element, "dynamics"), only_child(element, "mimic")
    limits = {} if limit is None else {name: number_or_none(limit, name) for name in LIMITS}
    friction = _friction(dynamics)
    law = ""
    if mimic is not None:
        given = mimic.attributes
        law = ", ".join(f"{each} {shown(given[each])}" for each in ("multiplier", "offset") if each in given)
    return Joint(
        name,
        kind,
        parent,
        child,
        at,
        rpy,
        None if axis is None or kind.text not in TYPES[:3] else numbers(axis, "xyz", 3),
        {name: value for name, value in limits.items() if value is not None},
        None if limit is None else limit.place,
        friction,
        None if dynamics is None or not any(friction.values()) else dynamics.place,
        None if mimic is None else word(mimic, "joint", '<mimic joint="..."/>'),
        law,
    )


def _friction(dynamics: Element | None) -> dict[str, float]:
    """Damping and friction. Raises Problem D206 for a negative one."""
    found = {}
    for name in FRICTION:
        given = None if dynamics is None else numbers(dynamics, name, 1)
        if given is not None:
            found[name] = given.values[0]
            if found[name] < 0.0:
                raise Problem(error("D206", f"`{name}` is below 0", given.place, help="write 0, or a number above it"))
    return found


def _check_names(named: Sequence[Link] | Sequence[Joint], kind: str, complaints: Complaints) -> None:
    first: dict[str, Place] = {}
    for each in named:
        if each.name.text in first:
            complaints.error(
                "D204",
                f"{kind} `{shown(each.name.text)}` is there twice",
                Label(each.name.place, "again"),
                also=[Label(first[each.name.text], "first")],
                help="give one of the two another name",
            )
        first.setdefault(each.name.text, each.name.place)


def _check_ends(links: Sequence[Link], joints: Sequence[Joint], complaints: Complaints) -> None:
    """Check that every joint is between existing links."""
    names = {link.name.text for link in links}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end.text not in names:
                complaints.error(
                    "D207",
                    f"no link `{shown(end.text)}` in this file",
                    end.place,
                    also=[Label(joint.name.place, f"joint `{shown(joint.name.text)}`")],
                    help=[*did_you_mean(end.text, names), known_words("links", map(shown, sorted(names)))],
                )


def _root(element: Element, links: Sequence[Link], joints: Sequence[Joint]) -> Link:
    """The link that no joint carries. Raises Problem D209 where there is none or more than one, or it carries
    nothing."""
    carried = {joint.child.text for joint in joints}
    roots = [link for link in links if link.name.text not in carried]
    if not joints:
        what = "has no joints: it is one body" if links else "is empty: it has no links"
        raise Problem(error("D209", f"this robot {what}", element.place, help="an arm has a joint at least"))
    if not roots:
        also = [Label(joint.name.place, f"joint `{shown(joint.name.text)}`") for joint in joints[1:MOST_NAMED]]
        raise Problem(
            error(
                "D209",
                "every link of this robot hangs on another: none is its base",
                joints[0].name.place,
                also=also,
                help="one of the joints closes a loop; a closed chain is not in this version",
            )
        )
    if len(roots) > 1:
        raise Problem(
            error(
                "D209",
                f"{len(roots)} links of this robot hang on no other, and an arm has one base",
                Label(roots[0].name.place, shown(roots[0].name.text)),
                also=[Label(each.name.place, shown(each.name.text)) for each in roots[1:MOST_NAMED]],
                help='join them by a `<joint type="fixed">`, or take one of the robots out of the file',
            )
        )
    return roots[0]
