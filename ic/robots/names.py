"""Unique names of a robot's parts that are valid in a deck.

The root is `base`. Another name stays as it is where a deck can write it: letters, digits and `_`, not a digit first.
Else, in this order:

1. each run of other characters becomes one `_`, and a name that begins with a digit gets `_` before it;
2. `_link` or `_joint` is added to a word that means something else (`base`, a unit such as `m`; a joint's `initial`),
   and `_joint` to a joint of a link's name;
3. `_2`, `_3`, ... is added to one that is taken.

Names that can stay as they are have the first choice, so that `arm-1` never takes the place of `arm_1`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ic.language import HEADS
from ic.robots.robot import Robot, Written
from met import units
from met.frozen import frozen

LONGEST = 200  # characters; a deck's names have 256 at most

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
_OTHER = re.compile(r"[^A-Za-z0-9_]+", re.ASCII)
_MACRO = re.compile(r"__\w+__")  # __LINE__ and its like: the preprocessor's


@frozen
class ChangedName:
    """A name that differs in decks."""

    kind: str  # "link", "joint"
    written: Written
    name: str


@frozen
class DeckNames:
    """The deck's name of each link and joint, by the file's; changed: those that differ, without the root."""

    links: Mapping[str, str]
    joints: Mapping[str, str]
    changed: tuple[ChangedName, ...]


def deck_names(robot: Robot) -> DeckNames:
    """The names of a robot's links and joints in a deck, and those that had to be changed."""
    links = {robot.root.name.text: "base"}
    links |= _named([link.name for link in robot.carried], "link", {"base"})
    joints = _named([joint.name for joint in robot.joints], "joint", set(links.values()))
    changed = [ChangedName("link", link.name, links[link.name.text]) for link in robot.carried]
    changed += [ChangedName("joint", joint.name, joints[joint.name.text]) for joint in robot.joints]
    return DeckNames(links, joints, tuple(change for change in changed if change.name != change.written.text))


def word(text: str, kind: str) -> str:
    """A single name: rules 1 and 2."""
    name = _OTHER.sub("_", text)[:LONGEST]
    name = name if _PLAIN.fullmatch(name) else f"_{name}"
    return f"{name}_{kind}" if _means_something(name, kind) else name


def _named(written: Sequence[Written], kind: str, taken: set[str]) -> dict[str, str]:
    """A name that decks allow for each element of a robot's file, by its name there; those that are allowed already
    stay. taken: names of other kinds."""
    names: dict[str, str] = {}
    others, taken = taken, set(taken)
    for element in sorted(written, key=lambda name: word(name.text, kind) != name.text):  # unchanged ones first
        new_name = word(element.text, kind)
        if new_name in others and kind == "joint":
            new_name = f"{new_name}_joint"
        base, n = new_name, 2
        while new_name in taken:
            new_name, n = f"{base}_{n}", n + 1
        names[element.text] = new_name
        taken.add(new_name)
    return names


def _means_something(name: str, kind: str) -> bool:
    reserved = name == "base" or units.is_unit(name) or _MACRO.fullmatch(name) is not None
    return reserved or (kind != "link" and name in HEADS)
