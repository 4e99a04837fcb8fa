"""Attributes and elements of a URDF file, read and checked; every fault placed at its element."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from ic.robots.robot import Numbers, Written
from ic.robots.xml import SHOWN, Element
from met.diagnostic import Label, Problem, did_you_mean, error

XACRO = "this is xacro, from which a URDF file is made: run `xacro FILE > robot.urdf` and take that"

_NOTHING = re.compile(r"\s*(?:[+-]?0(?:\.0*)?(?:\s+|$))+", re.ASCII)
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


def shown(text: str) -> str:
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."


def only_child(element: Element, tag: str) -> Element | None:
    """The element of this tag inside, None where there is none. Raises Problem D204 where there are two."""
    found = list(element.all(tag))
    if len(found) > 1:
        raise Problem(
            error(
                "D204",
                f"`<{tag}>` is there twice in this `<{element.tag}>`",
                Label(found[1].place, "again"),
                also=[Label(found[0].place, "first")],
                help="remove one of the two",
            )
        )
    return found[0] if found else None


def required_child(element: Element, tag: str, usage: str) -> Element:
    """The element of this tag inside. Raises Problem D204 where there are two, D205 where there is none."""
    found = only_child(element, tag)
    if found is None:
        raise Problem(error("D205", f"this `<{element.tag}>` has no `<{tag}>`", element.place, help=f"write `{usage}`"))
    return found


def word(element: Element, attribute: str, usage: str) -> Written:
    """The text of a required attribute. Raises Problem D205; D203 where xacro would have made it."""
    text = element.attributes.get(attribute, "").strip()
    if not text:
        raise Problem(
            error("D205", f"this `<{element.tag}>` has no `{attribute}`", element.place, help=f"write `{usage}`")
        )
    place = element.place_of(attribute)
    if "${" in text or "$(" in text:
        raise Problem(error("D203", f"`{shown(text)}` is to be filled in", place, help=XACRO))
    return Written(text, place)


def numbers(element: Element, attribute: str, count: int) -> Numbers | None:
    """The numbers of an attribute, None where it is not written. Raises Problem D206."""
    if attribute not in element.attributes:
        return None
    text, place = element.attributes[attribute], element.place_of(attribute)
    if "${" in text or "$(" in text:
        raise Problem(error("D203", f"`{shown(text)}` is to be filled in", place, help=XACRO))
    words = text.split()
    for each in words:
        if not _NUMBER.fullmatch(each) or not math.isfinite(float(each)):
            commas = "," in each and all(_NUMBER.fullmatch(part) for part in each.split(",") if part)
            remedy = "a number is finite, and written as 12.5 or -1e-3, without a unit"
            raise Problem(
                error(
                    "D206",
                    f"`{shown(each)}` is not a number",
                    place,
                    help="spaces part the numbers, not commas" if commas else remedy,
                )
            )
    if len(words) != count:
        wanted = "one number is" if count == 1 else f"{count} numbers are"
        raise Problem(
            error(
                "D206",
                f"{wanted} needed in `{attribute}` of `<{element.tag}>`, not {len(words)}",
                place,
                help="spaces part the numbers" if count > 1 else "write one, without a unit",
            )
        )
    return Numbers(tuple(float(each) + 0.0 for each in words), place)  # -0 is 0


def number(element: Element, attribute: str) -> Numbers:
    """One required number. Raises Problem D205, D206."""
    found = numbers(element, attribute, 1)
    if found is None:
        raise Problem(
            error(
                "D205",
                f"this `<{element.tag}>` has no `{attribute}`",
                element.place,
                help=f'write `<{element.tag} {attribute}="..."/>`',
            )
        )
    return found


def number_or_none(element: Element, attribute: str) -> float | None:
    """A number that is not used in computations; None where there is none."""
    text = element.attributes.get(attribute, "").strip()
    value = float(text) if _NUMBER.fullmatch(text) else math.inf
    return value + 0.0 if math.isfinite(value) else None


def refuse_unknown(element: Element, attributes: Iterable[str]) -> None:
    """Raise Problem D208 for any other attribute, unless all of it is 0: it might give a position or a mass."""
    names = list(attributes)
    for each, text in element.attributes.items():
        if each not in names and not _NOTHING.fullmatch(text):
            listed = ", ".join(f"`{name}`" for name in names)
            raise Problem(
                error(
                    "D208",
                    f"`<{element.tag}>` has no attribute `{shown(each)}`",
                    element.name_place(each),
                    help=[*did_you_mean(each, names), f"it has {listed}"],
                )
            )
