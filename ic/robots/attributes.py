"""What is read of a URDF file: a table of its elements with their attributes, and the one function that reads them.

Whatever the table does not have is either refused, because it is a misspelling or might say where something is or how
heavy, or counted, so that a warning can say that it was not read. Every fault is placed at its attribute or element.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import field

from ic.robots.robot import Numbers, Written
from ic.robots.xml import SHOWN, Element
from ic.text.complaints import Complaints
from met.diagnostic import Label, Place, Problem, did_you_mean, error, nearest
from met.frozen import frozen

XACRO = "this is xacro, from which a URDF file is made: run `xacro FILE > robot.urdf` and take that"
ALIKE = 0.8  # similarity of a misspelling: `gear_velocity`, which robots have, has 0.76 with `velocity`

ENDLESS = 1.79e308  # next to the largest double, which other programs write for no limit

_NOTHING = re.compile(r"\s*(?:[+-]?0(?:\.0*)?(?:\s+|$))+", re.ASCII)
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_ENDLESS = re.compile(r"([+-]?)inf(?:inity)?", re.ASCII | re.IGNORECASE)


@frozen
class Attribute:
    """The form of an attribute of URDF.

    count         how many numbers it holds; 0 stands for a word
    needed        whether its element must have it
    not_negative  whether its number may not be below 0
    no_limit      the infinity that may be written for "no limit", None where only finite numbers may
    """

    count: int = 1
    needed: bool = False
    not_negative: bool = False
    no_limit: float | None = None


@frozen
class ElementKind:
    """An element of a URDF file as it may be written.

    usage       how it is written, for messages
    inside      the elements inside that are read, each at most once, except those of `robot`
    needed      those of them that must be there
    refuses     whether any other attribute is refused unless all of it is 0; else it is counted as not read
    meant       other words for attributes, refused where those are not there, by word in small letters
    """

    usage: str
    attributes: Mapping[str, Attribute] = field(default_factory=dict)
    inside: tuple[str, ...] = ()
    needed: tuple[str, ...] = ()
    refuses: bool = False
    meant: Mapping[str, str] = field(default_factory=dict)


@frozen
class Found:
    """An element as read: its words and numbers by attribute, and the elements inside by tag."""

    place: Place
    words: Mapping[str, Written]
    numbers: Mapping[str, Numbers]
    inside: Mapping[str, Found]


WORD, NAME = Attribute(count=0), Attribute(count=0, needed=True)
NUMBER, VECTOR, NEEDED = Attribute(), Attribute(count=3), Attribute(needed=True)
FRICTION = Attribute(not_negative=True)

OF_LIMITS = {
    "min": "lower",
    "minimum": "lower",
    "low": "lower",
    "lower_limit": "lower",
    "max": "upper",
    "maximum": "upper",
    "high": "upper",
    "upper_limit": "upper",
    "torque": "effort",
    "force": "effort",
    "speed": "velocity",
}

ELEMENTS: Mapping[str, ElementKind] = {
    "robot": ElementKind('<robot name="...">', {"name": WORD, "version": WORD}, ("link", "joint")),
    "link": ElementKind('<link name="...">', {"name": NAME}, ("inertial",)),
    "inertial": ElementKind("<inertial>", {}, ("origin", "mass", "inertia"), ("mass", "inertia")),
    "origin": ElementKind('<origin xyz="0 0 0" rpy="0 0 0"/>', {"xyz": VECTOR, "rpy": VECTOR}, refuses=True),
    "mass": ElementKind('<mass value="..."/>', {"value": NEEDED}, refuses=True),
    "inertia": ElementKind(
        '<inertia ixx="..." iyy="..." izz="..." ixy="0" ixz="0" iyz="0"/>',
        {"ixx": NEEDED, "iyy": NEEDED, "izz": NEEDED, "ixy": NUMBER, "ixz": NUMBER, "iyz": NUMBER},
        refuses=True,
    ),
    "joint": ElementKind(
        '<joint name="..." type="revolute">',
        {"name": NAME, "type": NAME},
        ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
        ("parent", "child"),
    ),
    "parent": ElementKind('<parent link="..."/>', {"link": NAME}),
    "child": ElementKind('<child link="..."/>', {"link": NAME}),
    "axis": ElementKind('<axis xyz="0 0 1"/>', {"xyz": Attribute(count=3, needed=True)}, refuses=True),
    "limit": ElementKind(
        '<limit lower="..." upper="..." effort="..." velocity="..."/>',
        {
            "lower": Attribute(no_limit=-math.inf),
            "upper": Attribute(no_limit=math.inf),
            "effort": Attribute(no_limit=math.inf),
            "velocity": Attribute(no_limit=math.inf),
        },
        meant=OF_LIMITS,
    ),
    "dynamics": ElementKind('<dynamics damping="..." friction="..."/>', {"damping": FRICTION, "friction": FRICTION}),
    "mimic": ElementKind('<mimic joint="..."/>', {"joint": NAME, "multiplier": NUMBER, "offset": NUMBER}),
}


def printable(text: str) -> str:
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."


def read_element(element: Element, dropped: dict[str, list[Element]]) -> Found:
    """The element with all that is read inside of it; counts in `dropped` what is not. Raises Problem.

    D203: xacro would have filled it in;  D204: an element stands twice;  D205: one is missing, or an attribute;
    D206: no such numbers;  D208: an attribute or element that is refused.
    """
    kind, complaints = ELEMENTS[element.tag], Complaints()
    words: dict[str, Written] = {}
    numbers: dict[str, Numbers] = {}
    inside: dict[str, Found] = {}
    for name, text in element.attributes.items():
        known = kind.attributes.get(name)
        with complaints.gather():
            if known is None:
                _other_attribute(element, name, text, dropped)
            elif known.count:
                numbers[name] = _numbers(element, name, known)
            else:
                words[name] = Written(_filled_in(element, name).strip(), element.place_of(name))
    for name, known in kind.attributes.items():
        if known.needed and (name not in element.attributes or (name in words and not words[name].text)):
            what = f"this `<{element.tag}>` has no `{name}`"
            complaints.error("D205", what, element.place, help=f"write `{kind.usage}`")
    first: dict[str, Element] = {}
    for child in element.children:
        with complaints.gather():
            if child.tag not in kind.inside:
                _other_element(element, child, dropped)
            elif child.tag in first:
                complaints.error(
                    "D204",
                    f"`<{child.tag}>` is there twice in this `<{element.tag}>`",
                    Label(child.place, "again"),
                    also=[Label(first[child.tag].place, "first")],
                    help="remove one of the two",
                )
            elif element.tag != "robot":  # whose links and joints are read one by one
                first[child.tag] = child
                inside[child.tag] = read_element(child, dropped)
    for tag in kind.needed:
        if tag not in first:
            what = f"this `<{element.tag}>` has no `<{tag}>`"
            complaints.error("D205", what, element.place, help=f"write `{ELEMENTS[tag].usage}`")
    if complaints.errors:
        raise Problem(complaints.errors)
    return Found(element.place, words, numbers, inside)


def _filled_in(element: Element, attribute: str) -> str:
    """The text of an attribute. Raises Problem D203 where xacro would have made it."""
    text = element.attributes[attribute]
    if "${" in text or "$(" in text:
        place = element.place_of(attribute)
        raise Problem(error("D203", f"`{printable(text.strip())}` is to be filled in", place, help=XACRO))
    return text


def _numbers(element: Element, attribute: str, known: Attribute) -> Numbers:
    """The numbers of an attribute. Raises Problem D203, D206."""
    words, place = _filled_in(element, attribute).split(), element.place_of(attribute)
    numbers = [_number(word, attribute, place, known, count=len(words)) for word in words]
    if len(words) != known.count:
        wanted = "one number is" if known.count == 1 else f"{known.count} numbers are"
        raise Problem(
            error(
                "D206",
                f"{wanted} needed in `{attribute}` of `<{element.tag}>`, not {len(words)}",
                place,
                help="spaces part the numbers" if known.count > 1 else "write one, without a unit",
            )
        )
    if known.not_negative and min(numbers) < 0.0:
        raise Problem(error("D206", f"`{attribute}` is below 0", place, help="write 0, or a number above it"))
    return Numbers(tuple(numbers), place)


def _number(text: str, attribute: str, place: Place, known: Attribute, *, count: int) -> float:
    """One of `count` numbers of an attribute. Raises Problem D206."""
    endless = _ENDLESS.fullmatch(text)
    if known.no_limit is not None and endless is not None:
        if (endless[1] == "-") == (known.no_limit < 0.0):
            return known.no_limit
        help = f"`{known.no_limit:g}` stands for no limit"
        raise Problem(error("D206", f"`{attribute}` cannot be `{text}`", place, help=help))
    if _NUMBER.fullmatch(text) and math.isfinite(float(text)):
        value, none = float(text) + 0.0, known.no_limit  # -0 is 0
        return none if none is not None and abs(value) >= ENDLESS and (value < 0.0) == (none < 0.0) else value
    remedy = "a number is finite, and written as 12.5 or -1e-3, without a unit"
    if "," in text and all(_NUMBER.fullmatch(part) for part in text.split(",") if part):
        remedy = "spaces part the numbers, not commas"
        if count == known.count and _NUMBER.fullmatch(text.replace(",", ".")) and not text.endswith(","):
            remedy = f"the decimal sign is a point: `{printable(text.replace(',', '.'))}`"
    elif known.no_limit is not None:
        remedy = f"{remedy}; `{known.no_limit:g}` stands for no limit"
    raise Problem(error("D206", f"`{printable(text)}` is not a number", place, help=remedy))


def _other_attribute(element: Element, name: str, text: str, dropped: dict[str, list[Element]]) -> None:
    """Count an attribute that is not read. Raises Problem D208 where it is refused."""
    if name == "xmlns" or ":" in name:  # XML's own, and those of other formats
        return
    kind = ELEMENTS[element.tag]
    meant = kind.meant.get(name.lower(), "")
    meant = "" if meant in element.attributes else meant
    alike = bool(meant) or _alike(name, kind.attributes)
    if not alike and kind.refuses and _NOTHING.fullmatch(text):
        return
    if not alike and not kind.refuses:
        dropped.setdefault(f"{name} of {element.tag}", []).append(element)
        return
    listed = ", ".join(f"`{attribute}`" for attribute in kind.attributes)
    raise Problem(
        error(
            "D208",
            f"`<{element.tag}>` has no attribute `{printable(name)}`",
            element.name_place(name),
            help=[
                *([f"did you mean `{meant}`?"] if meant else did_you_mean(name, kind.attributes)),
                f"it has {listed}" if listed else "it has none",
            ],
        )
    )


def _other_element(element: Element, child: Element, dropped: dict[str, list[Element]]) -> None:
    """Count an element that is not read. Raises Problem D208 where it is a misspelling, or stands for an attribute."""
    kind = ELEMENTS[element.tag]
    helps = list(did_you_mean(child.tag, kind.inside)) if _alike(child.tag, kind.inside) else []
    if child.tag in kind.attributes:
        helps = [f"`{child.tag}` is an attribute: `{kind.usage}`"]
    if helps:
        what = f"`<{element.tag}>` has no element `<{printable(child.tag)}>`"
        raise Problem(error("D208", what, child.place, help=helps))
    dropped.setdefault(child.tag, []).append(child)


def _alike(name: str, known: Iterable[str]) -> bool:
    return len(name) <= SHOWN and nearest(name.lower(), known, ALIKE) is not None
