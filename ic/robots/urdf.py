"""The text of a URDF file to a `Robot`.

Links, joints, inertia and the files of visual meshes are read; what else the file holds is counted by name, so that
none of it is dropped in silence. Joints of kinds that MET does not have are read too: an arm made from the file may
remove or change them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ic.robots.attributes import XACRO, Found, printable, read_element
from ic.robots.robot import Inertial, Mimic, Numbers, Robot, RobotJoint, RobotLink
from ic.robots.visuals import link_visuals
from ic.robots.xml import MJCF, Element, parse
from ic.text.complaints import Complaints, known_words
from ic.text.limits import MOST_LINKS
from met.diagnostic import Label, Place, Problem, did_you_mean, error

MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
MOST_NAMED = 6  # places of a fault in one message

AS_DECK = "`met import FILE -o DECK.ic` makes a deck of an MJCF file"
_FORMATS = {"sdf": "SDF", "mujoco": "MuJoCo's MJCF", "svg": "a drawing", "html": "a web page", "COLLADA": "a mesh"}


def read(name: str, text: str) -> Robot:
    """The robot of a file. Raises Problem with all its errors."""
    root = parse(name, text)
    for element in _within(root):
        if element.tag.startswith("xacro:"):
            raise Problem(error("D203", f"`<{printable(element.tag)}>` is not URDF", element.place, help=XACRO))
    if root.tag != "robot":
        kind = _FORMATS.get(root.tag)
        what = f": this is {kind}" if kind else ""
        raise Problem(
            error(
                "D203",
                f"`<{printable(root.tag)}>` is not URDF{what}",
                root.place,
                help=AS_DECK if root.tag in MJCF else 'a URDF file is `<robot name="..."> ... </robot>`',
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
    dropped: dict[str, list[Element]] = {}
    unseen: dict[str, list[Element]] = {}
    links, joints, own = [], [], None
    with complaints.gather():
        own = read_element(root, dropped)
    for element in root.all("link"):
        with complaints.gather():
            link = _link(read_element(element, dropped))
            links.append(replace(link, visuals=link_visuals(element, name, dropped, unseen)))
    for element in root.all("joint"):
        with complaints.gather():
            joints.append(_joint(read_element(element, dropped)))
    _check_names(links, "link", complaints)
    _check_names(joints, "joint", complaints)
    if not complaints.errors:
        _check_ends(links, joints, complaints)
        _check_mimics(joints, complaints)
    if complaints.errors or own is None:
        raise Problem(complaints.errors)
    return Robot(
        name,
        own.words["name"].text if "name" in own.words else "",
        tuple(links),
        tuple(joints),
        _root(root, links, joints),
        {what: tuple(elements) for what, elements in dropped.items()},
        {what: tuple(elements) for what, elements in unseen.items()},
    )


def _within(root: Element) -> Iterator[Element]:
    """An element and all elements in it, in the order of the file."""
    stack = [root]
    while stack:
        element = stack.pop()
        yield element
        stack.extend(reversed(element.children))


def _link(element: Found) -> RobotLink:
    inertial = element.inside.get("inertial")
    return RobotLink(element.words["name"], None if inertial is None else _inertial(inertial))


def _inertial(element: Found) -> Inertial:
    """The inertia of a link: mass (kg), moments (kg m^2, 0 where left out), and the frame that they are in."""
    inertia = element.inside["inertia"]
    moments = [inertia.numbers.get(name) for name in MOMENTS]
    values = tuple(0.0 if moment is None else moment.values[0] for moment in moments)
    places = tuple(inertia.place if moment is None else moment.place for moment in moments)
    com, rpy = _origin(element)
    mass = element.inside["mass"].numbers["value"]
    return Inertial(mass, com, rpy, Numbers(values, inertia.place, places), element.place)


def _origin(element: Found) -> tuple[Numbers | None, Numbers | None]:
    """Place and rpy of the element `<origin>` inside, m and rad."""
    origin = element.inside.get("origin")
    return (None, None) if origin is None else (origin.numbers.get("xyz"), origin.numbers.get("rpy"))


def _joint(element: Found) -> RobotJoint:
    """The joint of an element; of what it does not have, None or nothing."""
    position, rpy = _origin(element)
    axis, limit, dynamics = (element.inside.get(tag) for tag in ("axis", "limit", "dynamics"))
    friction = {} if dynamics is None else {name: numbers.values[0] for name, numbers in dynamics.numbers.items()}
    return RobotJoint(
        element.words["name"],
        element.words["type"],
        element.inside["parent"].words["link"],
        element.inside["child"].words["link"],
        position,
        rpy,
        None if axis is None else axis.numbers["xyz"],
        {} if limit is None else limit.numbers,
        None if limit is None else limit.place,
        friction,
        None if dynamics is None or not any(friction.values()) else dynamics.place,
        _mimic(element.inside.get("mimic")),
    )


def _mimic(element: Found | None) -> Mimic | None:
    """The law by which a joint follows another, multiplier and offset; None where it follows none."""
    if element is None:
        return None
    law = {name: numbers.values[0] for name, numbers in element.numbers.items()}
    return Mimic(element.words["joint"], law.get("multiplier", 1.0), law.get("offset", 0.0))


def _check_names(named: Sequence[RobotLink] | Sequence[RobotJoint], kind: str, complaints: Complaints) -> None:
    """Report links, or joints, of one name (D204)."""
    first: dict[str, Place] = {}
    for element in named:
        if element.name.text in first:
            complaints.error(
                "D204",
                f"{kind} `{printable(element.name.text)}` is there twice",
                Label(element.name.place, "again"),
                also=[Label(first[element.name.text], "first")],
                help="give one of the two another name",
            )
        first.setdefault(element.name.text, element.name.place)


def _check_ends(links: Sequence[RobotLink], joints: Sequence[RobotJoint], complaints: Complaints) -> None:
    """Check that every joint is between existing links."""
    names = {link.name.text for link in links}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end.text not in names:
                complaints.error(
                    "D207",
                    f"no link `{printable(end.text)}` in this file",
                    end.place,
                    also=[Label(joint.name.place, f"joint `{printable(joint.name.text)}`")],
                    help=[*did_you_mean(end.text, names), known_words("links", map(printable, sorted(names)))],
                )


def _check_mimics(joints: Sequence[RobotJoint], complaints: Complaints) -> None:
    """Check that each joint that follows another follows, in the end, an existing one that moves by itself."""
    followed = {joint.name.text: joint.mimic for joint in joints}
    in_circles: set[str] = set()
    for joint in joints:
        if joint.mimic is None:
            continue
        leader = joint.mimic.joint
        if leader.text not in followed:
            complaints.error(
                "D207",
                f"no joint `{printable(leader.text)}` in this file",
                leader.place,
                also=[Label(joint.name.place, f"joint `{printable(joint.name.text)}`")],
                help=[*did_you_mean(leader.text, followed), known_words("joints", map(printable, sorted(followed)))],
            )
        name = joint.name.text
        mimic: Mimic | None = joint.mimic
        chain = {name: True}
        while mimic is not None and mimic.joint.text not in chain and mimic.joint.text in followed:
            chain[mimic.joint.text] = True
            mimic = followed[mimic.joint.text]
        if mimic is not None and mimic.joint.text == name and not in_circles.intersection(chain):
            in_circles.update(chain)
            complaints.error(
                "D213",
                f"joint `{printable(name)}` follows itself: {' -> '.join(map(printable, [*chain, name]))}",
                leader.place,
                help="remove the `<mimic>` of one of these joints in the file: it then moves by itself; no deck and no "
                "`--mimic` can change it",
            )


def _root(element: Element, links: Sequence[RobotLink], joints: Sequence[RobotJoint]) -> RobotLink:
    """The link that no joint carries. Raises Problem D209 where there is none or more than one, or it carries
    nothing."""
    carried = {joint.child.text for joint in joints}
    roots = [link for link in links if link.name.text not in carried]
    if not joints:
        what = "has no joints: it is one body" if links else "is empty: it has no links"
        raise Problem(error("D209", f"this robot {what}", element.place, help="an arm has a joint at least"))
    if not roots:
        also = [Label(joint.name.place, f"joint `{printable(joint.name.text)}`") for joint in joints[1:MOST_NAMED]]
        raise Problem(
            error(
                "D209",
                "every link of this robot hangs on another: none is its base",
                joints[0].name.place,
                also=also,
                help="one of the joints closes a loop: take it out, and close it by a stiff `bushing` in the run",
            )
        )
    if len(roots) > 1:
        raise Problem(
            error(
                "D209",
                f"{len(roots)} links of this robot hang on no other, and an arm has one base",
                Label(roots[0].name.place, printable(roots[0].name.text)),
                also=[Label(root.name.place, printable(root.name.text)) for root in roots[1:MOST_NAMED]],
                help='join them by a `<joint type="fixed">`, or take one of the robots out of the file',
            )
        )
    return roots[0]
